# Set-up of a developer's machine, sourced by tools/dev: Debian packages, the Python environment in .venv, and the
# project's own extension module. Stamps inside .venv hold a hash of what each step depends on, so that a second call
# does nothing and needs no network.

say() { printf '\n== %s\n' "$*"; }

# Runs a command and shows its output only when it fails.
quietly() {
  local log
  log=$(mktemp)
  "$@" >"$log" 2>&1 </dev/null || { cat "$log" >&2; rm -f "$log"; return 1; }
  rm -f "$log"
}

hash_of() { find "$@" -type f ! -name '*.pyc' -print0 | sort -z | xargs -0 sha256sum | sha256sum; }

# --- Debian packages

is_installed() { dpkg-query -W -f '${Status}' "$1" 2>/dev/null | grep -q '^install ok installed'; }

# `pyenv` and friends put their own python3 first; any Python will do that can make an environment and compile for it.
find_python() {
  local candidate
  for candidate in python3 /usr/bin/python3 python3.13 python3.12 python3.11; do
    "$candidate" 2>/dev/null </dev/null -c '
import ensurepip, os, sys, sysconfig
header = os.path.join(sysconfig.get_path("include"), "Python.h")
if sys.version_info < (3, 11) or not os.path.exists(header):
    sys.exit(1)
print(sys._base_executable)' && return 0
  done
  return 1
}

missing_packages() {
  command -v c++ >/dev/null || echo g++
  command -v cmake >/dev/null || echo cmake
  command -v ninja >/dev/null || echo ninja-build
  find_python >/dev/null || printf '%s\n' python3 python3-venv python3-dev
  local package
  for package in libeigen3-dev libceres-dev libgtest-dev libbenchmark-dev; do
    is_installed "$package" || echo "$package"
  done
}

# apt_install PACKAGE...: fails where it may not; asks for a password only when somebody can type it.
apt_install() {
  local as_root=(env)
  if [ "$(id -u)" != 0 ]; then
    as_root=(sudo)
    [ -t 0 ] || as_root=(sudo -n)
    "${as_root[@]}" true 2>/dev/null || return 1
  fi
  local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=120)
  quietly "${apt[@]}" update && quietly "${apt[@]}" install -y --no-install-recommends "$@"
}

system_packages() {
  command -v dpkg-query >/dev/null || return 0  # not Debian: CMake and pip will name what is missing
  local missing
  mapfile -t missing < <(missing_packages)
  [ ${#missing[@]} -gt 0 ] || return 0
  say "system packages: ${missing[*]}"
  apt_install "${missing[@]}" || {
    echo "Please install the missing system packages, then run this command again:" >&2
    echo "  sudo apt-get install --no-install-recommends ${missing[*]}" >&2
    return 1
  }
}

# optional_packages PACKAGE...: tries to install them; whoever needs one says what is skipped without it.
optional_packages() {
  local package
  for package in "$@"; do
    if command -v dpkg-query >/dev/null && ! is_installed "$package"; then
      say "optional system package: $package"
      apt_install "$package" >/dev/null 2>&1 || echo "not installed: sudo apt-get install $package"
    fi
  done
}

# --- Python

pip_install() { quietly .venv/bin/python -m pip install --disable-pip-version-check --no-input "$@"; }

# requirements KEY...: the list that stands there in pyproject.toml, one a line.
requirements() {
  .venv/bin/python -c '
import functools, sys, tomllib
print(*functools.reduce(dict.get, sys.argv[1:], tomllib.load(open("pyproject.toml", "rb"))), sep="\n")' "$@"
}

# install_project TUBES [OPTION...] -e WHAT: Python sources are used from the tree; the extension is compiled (again) for
# robots of these numbers of tubes.
install_project() {
  pip_install --no-build-isolation --config-settings build-dir=build/python --config-settings "cmake.define.CTCR_TUBES=$1" "${@:2}"
}
all_tubes="1;2;3;4"

environment_hash() { { pwd; hash_of pyproject.toml tools/setup.sh; } | sha256sum; }
extension_hash() { hash_of pyproject.toml CMakeLists.txt cmake include tools/ctcr/_core; }
demonstration_hash() { environment_hash; extension_hash; }

is_stamped() { [ -f ".venv/.$1" ] && [ "$(cat ".venv/.$1")" = "$($1)" ]; }

# stamped HASH COMMAND...: runs the command and remembers the hash of what it saw.
stamped() {
  local value
  value=$($1)
  "${@:2}"
  echo "$value" >".venv/.$1"
}

# An environment that can compile the project.
virtual_environment() {
  system_packages
  local python packages
  python=$(find_python) || { echo "Python 3.11 or newer is needed, with venv and its C headers" >&2; return 1; }
  say "Python packages into .venv"
  .venv/bin/python -m pip --version >/dev/null 2>&1 || "$python" -m venv --clear .venv
  mapfile -t packages < <(requirements build-system requires)
  pip_install "${packages[@]}"
}

environment() {
  virtual_environment
  stamped extension_hash install_project "$all_tubes" -e '.[dev]'
  # Programs of others that the simulated devices are tested with; the tests say what they skip without them.
  pip_install ndicapi scikit-surgerynditracker kickcat >/dev/null 2>&1 || echo "not installed: ndicapi and others"
}

is_set_up() { is_stamped environment_hash && .venv/bin/python -c ''; }

setup() {
  if ! is_set_up 2>/dev/null; then
    stamped environment_hash environment
  elif ! is_stamped extension_hash; then
    say "extension module"
    stamped extension_hash install_project "$all_tubes" --no-deps -e .
  fi
}

# What the demonstration needs takes half as long: models of its three tubes, and no packages of developers.
small_environment() {
  virtual_environment
  install_project 3 -e .
}
setup_for_demonstration() {
  if is_set_up 2>/dev/null; then
    setup
  elif ! is_stamped demonstration_hash 2>/dev/null; then
    stamped demonstration_hash small_environment
  fi
}
