"""What the tests of the checkers share: a tree with planted mistakes, and what a checker finds in it."""

import os
import sys
import tempfile


def run(check, tree, cases):
    """Writes `tree` ({path: text}) and the cases into a new folder and has `check(folder)` return "path:line: what" for each
    problem. A case is (path, text, what): `what` must be in a problem of that file, or nothing be found in it for None.
    Returns what went otherwise, a line each, and all problems."""
    with tempfile.TemporaryDirectory() as root:
        for path, text in [*tree.items(), *((path, text) for path, text, _ in cases)]:
            path = os.path.join(root, path)
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "w", encoding="utf-8") as file:
                file.write(text + "\n")
        problems = check(root)
    failures = []
    for path, text, what in cases:
        found = [problem for problem in problems if problem.startswith(path + ":")]
        if (what is None) != (not found) or (what and not any(what in problem for problem in found)):
            failures.append(f"{path}: {text!r}: expected {what!r}, found {found}")
    return failures, problems


def tell(name, cases, failures):
    """Prints the outcome; returns the exit code."""
    for failure in failures:
        print(f"{name}: {failure}", file=sys.stderr)
    print(f"{name}: self-test of {cases} cases: {'failed' if failures else 'passed'}")
    return 1 if failures else 0
