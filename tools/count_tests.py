#!/usr/bin/env python3
"""Adds up the JUnit files below a folder and prints 'N passed, N failed, N skipped'."""

import sys
from pathlib import Path
from xml.etree import ElementTree

passed = failed = skipped = 0
for file in Path(sys.argv[1]).rglob("*.xml"):
    for case in ElementTree.parse(file).iter("testcase"):
        if case.find("failure") is not None or case.find("error") is not None:
            print(f"failed: {case.get('classname')}.{case.get('name')}")
            failed += 1
        elif case.find("skipped") is not None:
            skipped += 1
        else:
            passed += 1
print(f"{passed} passed, {failed} failed, {skipped} skipped")
sys.exit(failed > 0 or passed == 0)
