"""The main function that the checkers share: their arguments, what they print, their exit codes."""

import os
import sys


def main(name, doc, check, arguments=None):
    """Runs `check(root)`, which returns ([problem], summary): prints each problem, and the summary with the checker's name. `doc` is
    what --help prints. Returns 0 if there is no problem, 1 if there is one, 2 if the arguments are wrong or a program is missing."""
    arguments = sys.argv[1:] if arguments is None else arguments
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    if len(arguments) == 2 and arguments[0] == "--root":
        root = arguments[1]
    elif arguments:
        print(doc.strip(), file=sys.stderr)
        return 0 if arguments in (["-h"], ["--help"]) else 2
    try:
        problems, summary = check(root)
    except FileNotFoundError as error:
        print(f"{name}: {error.filename} is missing; scripts/setup.sh --with-checks installs what checks need", file=sys.stderr)
        return 2
    for problem in problems:
        print(problem)
    print(f"{name}: {summary}" if not problems else f"{name}: {len(problems)} finding(s)", file=sys.stderr if problems else sys.stdout)
    return 1 if problems else 0
