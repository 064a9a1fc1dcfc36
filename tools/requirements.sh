#!/usr/bin/env bash
# Installs tools/requirements.txt (evo, for the second opinion of evaluate_run.py, cmocean, for the
# reports' colours, and pyxtf, for XTF files in import_survey.py) from PyPI, beside the package's own Python modules, where setup.bash lets
# python find them. Idempotent.
#   tools/requirements.sh [FOLDER]    FOLDER: by default of the package in the workspace, devel or
#                                     install, that has been sourced
set -euo pipefail
export PATH=/usr/bin:/bin:$PATH
requirements=$(cd "$(dirname "$0")" && pwd)/requirements.txt

folder=${1:-}
if [ -z "$folder" ]; then
  find_package='import pathlib, rbpf_svgp_slam as r; print(pathlib.Path(r.__file__).parents[1])'
  folder=$(python3 -c "$find_package" 2>/dev/null) || {
    echo "requirements.sh: no rbpf_svgp_slam found, expected a sourced setup.bash or a folder" >&2
    exit 1
  }
fi
installed=$folder/rbpf_svgp_slam_requirements.txt
cmp -s "$requirements" "$installed" && exit
echo "Installing evo, cmocean and pyxtf into $folder ..."
python3 -m pip install --quiet --disable-pip-version-check --root-user-action ignore \
  --no-deps --upgrade --target "$folder" -r "$requirements"
cp "$requirements" "$installed"
