"""Learning curves as an image, if matplotlib is installed."""


def plot(entries, path, name):
    """Writes the curves of the log `entries` to the image `path`; does nothing without matplotlib."""
    try:
        import matplotlib
    except ImportError:
        return
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    steps = [entry["step"] for entry in entries]
    figure, axes = plt.subplots(1, 3, figsize=(13, 3.6), constrained_layout=True)
    for key, label in [("l1", "training, L1"), ("flow", "training, velocity²"), ("validation", "held out, L1"),
                       ("hold_first_row", "first row held, L1")]:  # fmt: skip
        if all(key in entry for entry in entries):
            axes[0].plot(steps, [entry[key] for entry in entries], label=label)
    axes[0].set(xlabel="step", ylabel="error of normalised actions", yscale="log", title=name)
    axes[0].legend()
    if all("kl" in entry for entry in entries):
        axes[1].plot(steps, [entry["kl"] for entry in entries], label="divergence of the latent, nats")
        axes[1].set(yscale="log")
        axes[1].legend()
    axes[1].set(xlabel="step")
    right = axes[1].twinx()
    right.plot(steps, [entry["lr"] for entry in entries], color="grey", linewidth=0.8)
    right.set(ylabel="learning rate")
    by_row = entries[-1].get("validation_by_row")
    if by_row:
        axes[2].plot(range(1, len(by_row) + 1), by_row)
        axes[2].set(xlabel="row of the chunk", ylabel="held out, L1", title=f"step {steps[-1]}", ylim=(0, None))
    figure.savefig(path, dpi=110)
    plt.close(figure)
