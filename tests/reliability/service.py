"""Promises that tests of the running service show (R32, R37): runs them, and tells how many there were.

    service.py NAME
"""

import re
import subprocess
import sys
import pathlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from outside import TOP, check

# what is told of the tests of these modules
MODULES = {"auth": ("auth::", "owners::"), "hostile_worker": ("hostile_worker::",)}
FIGURES = {
    "auth": "every operation with 11 kinds of tokens and none over both protocols; streams, owners, hosts, origins and proxies (%d tests)",
    "hostile_worker": "a wrong token, jobs of others, old leases, gaps, wrong hashes, results of 10 GiB, numbers that are not finite, nonsense: "
                      "refused and told, nothing stored, each job solved by another worker (%d tests)",
}


def main():
    name = sys.argv[1]
    # the same selection of packages as tests/run: nothing is compiled again
    command = ["cargo", "test", "--release", "--workspace", "--test", "service", "--", *MODULES[name]]
    told = subprocess.run(command, cwd=TOP, check=True, stdout=subprocess.PIPE, text=True).stdout
    passed = sum(int(count) for count in re.findall(r"(\d+) passed", told))
    check(passed > 0, "no test was run")
    print("figure: " + FIGURES[name] % passed)


main()
