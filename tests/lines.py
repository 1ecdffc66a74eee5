#!/usr/bin/env python3
"""Prints the lines of Rust in each room: code, comments and tests apart. Blank lines do not count.

    tests/lines.py [COMMIT] [--compare COMMIT]

Without a commit the files of the working tree are counted. With --compare each room has the lines of code of that
commit, too, and the difference.

A line with code and a comment is code. Tests are the items under `#[cfg(test)]`, with the files of modules that are
declared there, and everything in folders and packages named `tests`; their comments count as tests. A room is the first
name below `src`, as in ARCHITECTURE.md, or a crate that is one room; the crates of `server` stand together. `build` is
the build script of a package. Generated Rust is not in the
repository and not counted. Below the rooms are totals of other languages.
"""

import argparse
import collections
import pathlib
import re
import subprocess
import sys

TOP = pathlib.Path(__file__).resolve().parent.parent
TOKEN = re.compile(
    r"""(?P<space>\s+)
      | (?P<comment>//[^\n]*)
      | (?P<block>/\*)
      | (?P<code>[bc]?r(?P<hashes>\#*)".*?"(?P=hashes)          # raw string
          | [bc]?"(?:\\.|[^"\\])*"
          | b?'(?:\\(?:u\{[^}]*\}|x..|.)|[^'\\\n])'             # character; a lifetime has no second quote
          | (?:r\#)?\w+
          | .)""",
    re.VERBOSE | re.DOTALL,
)
KINDS = ("code", "comments", "tests")
# Crates that are one room; what only tests use.
ONE_ROOM = ("server/app", "server/cli", "server/store", "server/fake")
FOR_TESTS = ("server/fake/", "server/store/src/for_tests.rs")


def files_of(commit):
    """The text of each file that has lines to count, by path."""
    if commit:
        listing = ["ls-tree", "-r", "--name-only", "-z", commit]
    else:
        listing = ["ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    paths = [path for path in git(*listing).decode().split("\0") if language(path)]
    if not commit:
        return {path: (TOP / path).read_text(encoding="utf-8") for path in paths if (TOP / path).is_file()}
    request = "".join("%s:%s\n" % (commit, path) for path in paths)
    answer = git("cat-file", "--batch", input=request.encode())
    texts, at = {}, 0
    for path in paths:
        head = answer.index(b"\n", at)
        size = int(answer[at:head].split()[-1])
        texts[path] = answer[head + 1 : head + 1 + size].decode()
        at = head + 1 + size + 1
    return texts


def git(*words, input=None):
    return subprocess.run(["git", *words], cwd=TOP, input=input, stdout=subprocess.PIPE, check=True).stdout


def language(path):
    """The row of a path among the totals, `Rust` for the rooms, `manifest` for what names a package, or nothing."""
    name = path.rsplit("/", 1)[-1]
    if name == "Cargo.toml":
        return "manifest"
    if path.endswith(".rs"):
        return "Rust"
    if path.endswith(".sql"):
        return "migrations"
    if path.endswith(".proto"):
        return "gRPC contract"
    if path.endswith(".md"):
        return "documents (Markdown)"
    if path.endswith(".py"):
        if not path.startswith("clients/python/"):
            return "tests in Python"
        return "Python client" if path.startswith("clients/python/src/") else "tests and tools of the Python client"
    return None


def tokens(text):
    """The tokens of a Rust text with their places: kind (`code`, `comment`), words, first and last line."""
    at, line = 0, 1
    while at < len(text):
        found = TOKEN.match(text, at)
        end = found.end()
        if found["block"]:
            depth = 1
            while depth and end < len(text):
                if text.startswith("/*", end):
                    depth, end = depth + 1, end + 2
                elif text.startswith("*/", end):
                    depth, end = depth - 1, end + 2
                else:
                    end += 1
        word = text[at:end]
        last = line + word.count("\n")
        if found["code"]:
            yield "code", word, line, last
        elif not found["space"]:
            yield "comment", word, line, last
        at, line = end, last


def rust_lines(text):
    """The kind of each line that is not blank, and the modules that are declared for tests only."""
    stream = list(tokens(text))
    words = [word if kind == "code" else "" for kind, word, _, _ in stream]
    in_tests, modules = items_of_tests(words)
    kinds = {}
    lines = text.split("\n")
    for at, (kind, _, first, last) in enumerate(stream):
        here = "tests" if at in in_tests else {"code": "code", "comment": "comments"}[kind]
        for line in range(first, last + 1):
            rank = ("comments", "tests", "code")
            if lines[line - 1].strip() and rank.index(here) >= rank.index(kinds.get(line, "comments")):
                kinds[line] = here
    return collections.Counter(kinds.values()), modules


def items_of_tests(words):
    """The places of all tokens under `#[cfg(test)]`, or of all if the file begins with `#![cfg(test)]`."""
    code = [(at, word) for at, word in enumerate(words) if word]
    plain = [word for _, word in code]
    found, modules = set(), set()
    at = 0
    while at < len(plain):
        if plain[at : at + 8] == list("#![") + ["cfg", "(", "test", ")", "]"]:
            return set(range(len(words))), modules
        if plain[at : at + 7] != ["#", "[", "cfg", "(", "test", ")", "]"]:
            at += 1
            continue
        start, at, depth = at, at + 7, 0
        first_word = ""
        while at < len(plain):
            word = plain[at]
            # another attribute of the same item
            if not first_word and word == "#":
                at = closing(plain, at + 1)
                continue
            first_word = first_word or word
            depth += (word in ("(", "[", "{")) - (word in (")", "]", "}"))
            at += 1
            if depth == 0 and word == "}" and plain[at : at + 1] == [";"]:
                at += 1
            if depth == 0 and word in (";", "}"):
                break
        item = plain[start + 7 : at]
        if len(item) >= 3 and item[-1] == ";" and "mod" in item[-3:]:
            modules.add(item[-2])
        found.update(range(code[start][0], code[at - 1][0] + 1))
    return found, modules


def closing(plain, at):
    """The place after the bracket that closes the one at `at`."""
    depth = 0
    while at < len(plain):
        depth += (plain[at] == "[") - (plain[at] == "]")
        at += 1
        if depth == 0:
            break
    return at


def children(path, module):
    """Where the file or the folder of a module declared in `path` may be."""
    folder, name = path.rsplit("/", 1)
    if name not in ("lib.rs", "main.rs", "mod.rs"):
        folder += "/" + name.removesuffix(".rs")
    return "%s/%s.rs" % (folder, module), "%s/%s/" % (folder, module)


def count(commit):
    """Lines by package and room, and totals of the other languages."""
    texts = files_of(commit)
    packages = sorted((path.removesuffix("Cargo.toml") for path in texts if path.endswith("/Cargo.toml")), key=len)
    counted = {path: rust_lines(text) for path, text in texts.items() if language(path) == "Rust"}
    of_tests = [place for path, (_, modules) in counted.items() for module in modules for place in children(path, module)]
    rooms, others = collections.defaultdict(collections.Counter), collections.Counter()
    for path, (lines, _) in counted.items():
        package = next((package for package in reversed(packages) if path.startswith(package)), "")
        parts = path.removeprefix(package).split("/")
        room = (parts[1] if parts[0] == "src" and len(parts) > 1 else parts[0]).removesuffix(".rs")
        if "tests" in path.split("/") or path.startswith(FOR_TESTS) or any(path.startswith(place) for place in of_tests):
            lines = collections.Counter(tests=sum(lines.values()))
        package = package.rstrip("/")
        if package in ONE_ROOM:
            room = package.rsplit("/", 1)[-1]
        rooms[package.split("/")[0] or ".", room].update(lines)
    for path, text in texts.items():
        if language(path) not in ("Rust", "manifest"):
            others[language(path)] += sum(1 for line in text.split("\n") if line.strip())
    return rooms, others


def table(now, then):
    """The rows to print: names, then numbers."""
    rows = []
    sums = collections.defaultdict(lambda: (collections.Counter(), collections.Counter()))
    for package, room in sorted(set(now) | set(then or {})):
        new, old = now.get((package, room), collections.Counter()), (then or {}).get((package, room), collections.Counter())
        rows.append((package, room, new, old))
        for key in (package, ""):
            sums[key][0].update(new)
            sums[key][1].update(old)
    printed = []
    for package in sorted({package for package, *_ in rows}):
        printed += [row for row in rows if row[0] == package]
        printed.append((package, "(all rooms)", *sums[package]))
    return [*printed, ("all Rust", "", *sums[""])]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", nargs="?", metavar="COMMIT")
    parser.add_argument("--compare", metavar="COMMIT")
    options = parser.parse_args()
    try:
        now, others = count(options.commit)
        then, others_then = count(options.compare) if options.compare else (None, {})
    except subprocess.CalledProcessError as error:
        sys.exit("git failed: %s" % " ".join(error.cmd))
    compared = ["before", "change"] if options.compare else []
    print("%-12s %-14s" % ("package", "room") + "".join("%10s" % name for name in [*KINDS, *compared]))
    previous = ""
    for package, room, new, old in table(now, then):
        numbers = [str(new[kind]) for kind in KINDS]
        if options.compare:
            numbers += [str(old["code"]), "%+d" % (new["code"] - old["code"])]
        shown = "" if package == previous and room != "(all rooms)" else package
        print("%-12s %-14s" % (shown, room) + "".join("%10s" % number for number in numbers))
        previous = package
    print()
    for name in sorted(set(others) | set(others_then)):
        change = "%20d%+10d" % (others_then[name], others[name] - others_then[name]) if options.compare else ""
        print("%-47s%10d%s" % (name, others[name], change))


if __name__ == "__main__":
    main()
