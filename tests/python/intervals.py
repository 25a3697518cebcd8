"""Writes client/campaign/src/evaluate/intervals.csv: intervals of shares and p values of pairs by
scipy and statsmodels, with which `cargo test -p wheelarm-campaign` compares ours.

    pip install scipy statsmodels
    python tests/python/intervals.py > client/campaign/src/evaluate/intervals.csv
"""

import csv
import sys

import numpy as np
import scipy
import statsmodels
from scipy.stats import beta, binomtest
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.proportion import proportion_confint

TRIALS = [1, 2, 3, 4, 7, 10, 20, 25, 50, 100, 200, 333, 1000, 3000]
PAIRS = [0, 1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144, 233, 377]


def main() -> None:
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["what", "a", "b", "first", "second"])
    for n in TRIALS:
        for k in sorted({0, 1, 2, n // 5, n // 3, n // 2, n - n // 4, n - 1, n} & set(range(n + 1))):
            low, high = proportion_confint(k, n, 0.05, "wilson")
            out.writerow(["wilson", k, n, repr(float(low)), repr(float(high))])
            low, high = proportion_confint(k, n, 0.05, "beta")
            # The same with scipy alone.
            own = [0.0 if k == 0 else beta.ppf(0.025, k, n - k + 1), 1.0 if k == n else beta.ppf(0.975, k + 1, n - k)]
            assert np.allclose([low, high], own, rtol=0, atol=1e-12), (k, n)
            out.writerow(["clopper_pearson", k, n, repr(float(low)), repr(float(high))])
    for b in PAIRS:
        for c in PAIRS:
            p = mcnemar([[9, b], [c, 9]], exact=True).pvalue
            if b + c:
                # statsmodels returns more than 1 for equal counts.
                other = binomtest(min(b, c), b + c, 0.5).pvalue
                assert abs(min(p, 1.0) - other) < 1e-12, (b, c)
            else:
                p = 1.0
            out.writerow(["mcnemar", b, c, repr(float(min(p, 1.0))), "0"])
    print(f"scipy {scipy.__version__}, statsmodels {statsmodels.__version__}", file=sys.stderr)


main()
