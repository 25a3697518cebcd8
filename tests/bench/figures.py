"""How a measurement tells its figures: lines `figure NAME NUMBER`."""


def figure(name, value):
    """Prints one figure."""
    print(f"figure {name} {value:.6g}", flush=True)


def read(text):
    """Figures in the output of a program, by name."""
    found = {}
    for line in text.splitlines():
        words = line.split()
        if len(words) == 3 and words[0] == "figure":
            found[words[1]] = float(words[2])
    return found
