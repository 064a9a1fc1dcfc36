#!/usr/bin/env bash
# Installs what is missing of tools/packages.txt and builds the package, Release, into build/.
# Idempotent: a second run takes seconds. With --test or --bench also what only the tests or the
# benchmarks need from PyPI, with --fuzz tools/packages-fuzz.txt. Other arguments go to cmake, e.g.
# -DRBPF_NATIVE=ON.
set -euo pipefail
cd "$(dirname "$0")/.."
export PATH=/usr/bin:/bin:$PATH

test=false
bench=false
lists=(tools/packages.txt)
case ${1:-} in
  --test) test=true ;;
  --bench) bench=true ;;
  --fuzz)
    lists+=(tools/packages-fuzz.txt)
    shift
    ;;
esac
if $test || $bench; then
  shift
  set -- -DRBPF_BENCH=ON "$@"
fi

mapfile -t packages < <(grep -hv '^#' "${lists[@]}")
missing=()
for package in "${packages[@]}"; do
  [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] ||
    missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  echo "Installing ${#missing[@]} packages: ${missing[*]}"
  sudo=()
  [ "$(id -u)" = 0 ] || sudo=(sudo)
  "${sudo[@]}" apt-get update -qq
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi

if [ ! -f build/Makefile ] || [ $# -gt 0 ]; then
  cmake -S . -B build -DCMAKE_BUILD_TYPE=Release -DPYTHON_EXECUTABLE=/usr/bin/python3 "$@" \
    >build.log 2>&1 || { cat build.log; exit 1; }
  mv build.log build/configure.log
fi
echo "Building (a few minutes the first time, seconds after that) ..."
cmake --build build --parallel "$(nproc)" >build/build.log 2>&1 || { cat build/build.log; exit 1; }

# What evaluation and figures need and Debian does not have.
tools/requirements.sh build/devel/lib/python3/dist-packages

# A virtual environment with what a file of requirements asks for, made anew when that changes.
#   environment FOLDER REQUIREMENTS [OPTION OF venv ...]
environment() {
  local folder=$1 requirements=$2
  shift 2
  cmp -s "$requirements" "$folder/requirements.txt" && return
  echo "Installing $requirements into $folder ..."
  python3 -m venv --clear "$@" "$folder"
  "$folder/bin/pip" install --quiet --disable-pip-version-check -r "$requirements"
  cp "$requirements" "$folder/requirements.txt"
}
if $test; then
  environment build/venv tools/requirements-test.txt
  wheels=build/wheels  # of those, for other workspaces
  if ! cmp -s tools/requirements.txt "$wheels/requirements.txt"; then
    python3 -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$wheels" \
      -r tools/requirements.txt
    cp tools/requirements.txt "$wheels/requirements.txt"
  fi
fi
if $bench; then
  environment build/bench/newest tools/requirements-bench-newest.txt
  environment build/bench/same_torch tools/requirements-bench-same-torch.txt --system-site-packages
fi
