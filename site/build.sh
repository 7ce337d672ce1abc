#!/usr/bin/env bash
# The documents as a site, in target/site/html: the pages of docs/, the reference of the Python
# package from its docstrings, and a gallery of live leaves. With the path of the program as an
# argument the gallery has pictures. It takes Python 3.10 or later, and what requirements.txt names.
set -euo pipefail
cd "$(dirname "$0")/.."
venv=target/site/venv
if ! "$venv/bin/mkdocs" --version >/dev/null 2>&1 || test site/requirements.txt -nt "$venv/pyvenv.cfg"; then
    python3 -m venv --clear "$venv"
    "$venv/bin/pip" install --quiet -r site/requirements.txt
fi
"$venv/bin/python" site/assemble.py target/site/source "$@"
"$venv/bin/mkdocs" build --strict --quiet -f site/mkdocs.yml
echo "the site is target/site/html"
