#!/usr/bin/env python3
"""Adds up the JUnit files below a folder and prints 'N passed, N failed, N skipped'."""

import sys
from pathlib import Path
from xml.etree import ElementTree

passed = failed = skipped = 0
for file in Path(sys.argv[1]).rglob("*.xml"):
    tree, named = ElementTree.parse(file), 0
    for case in tree.iter("testcase"):
        if case.find("failure") is not None or case.find("error") is not None:
            print(f"failed: {case.get('classname')}.{case.get('name')}")
            named += 1
        elif case.find("skipped") is not None:
            skipped += 1
        else:
            passed += 1
    # rostest counts the failures of subtests, and names none of them
    suites = tree.iter("testsuite")
    claimed = sum(int(suite.get(name, 0)) for suite in suites for name in ("failures", "errors"))
    if claimed > named:
        print(f"failed: {claimed - named} in {file.name} that are not named there")
    failed += max(claimed, named)
print(f"{passed} passed, {failed} failed, {skipped} skipped")
sys.exit(failed > 0 or passed == 0)
