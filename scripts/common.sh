# shellcheck shell=bash disable=SC2034
# Sourced by the scripts beside it: the one list of Debian packages, and how a step is run and a failure told.

# What the library, the command and the demo need.
core_packages=(
  cmake g++ ninja-build pkg-config
  libcli11-dev libeigen3-dev libexpected-dev libfmt-dev libhwy-dev liblzf-dev libnanoflann-dev
  libyaml-cpp-dev nlohmann-json3-dev zlib1g-dev
  libopencv-core-dev libopencv-imgcodecs-dev libopencv-imgproc-dev
)
# Live back-ends, and what the tests use besides.
test_packages=(libcamera-dev libopenni2-dev libgmock-dev libgtest-dev librapidcheck-dev python3-jsonschema)
# What the benchmarks compare with, and the speed benchmark besides.
peer_packages=(libcgal-dev libpcl-dev)
speed_peer_packages=(libopencv-contrib-dev)
# What scripts/long-qemu needs besides; what runs in the emulated machine is unpacked, not installed.
qemu_packages=(qemu-system-x86)
# What .ci/run needs besides: to check sources, to read exports back (260 MB), to write STEP (183 MB) and to see the
# window of --view (270 MB, Qt among it); tests that miss these are skipped and say so.
ci_packages=(clang-format-19 clang-tidy-19 libocct-data-exchange-dev libopencv-highgui-dev python3-vtk9 xdotool xvfb)

script_name=scripts/${0##*/}
fail() {
  printf '%s: %s\n' "$script_name" "$1" >&2
  exit 1
}

# step NAME LOG COMMAND…: runs it with its output in LOG; when it fails, shows the end of the log and stops.
step() {
  local name=$1 log=$2 start=$SECONDS status
  shift 2
  mkdir -p "$(dirname "$log")"
  printf '%-34s ' "$name"
  if "$@" >"$log" 2>&1 </dev/null; then
    printf '%4d s\n' $((SECONDS - start))
    return
  else
    status=$?
  fi
  printf 'FAILED\n'
  tail -n 20 "$log" | sed 's/^/    /' >&2
  fail "the step \"$name\" failed with exit code $status; all of its output: $log"
}

missing_packages() {
  local package
  for package in "$@"; do
    [[ $(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) == installed ]] || printf '%s\n' "$package"
  done
}

# install_missing LOG_DIR PACKAGE…: as root, or through sudo; where neither can be, says the line to type.
install_missing() {
  local logs=$1 missing as_root=()
  shift
  if ! command -v apt-get >/dev/null; then
    printf 'no apt-get here: these Debian packages, or what they are called on this system, must be there:\n  %s\n' "$*"
    return
  fi
  mapfile -t missing < <(missing_packages "$@")
  if [[ ${#missing[@]} == 0 ]]; then
    printf 'packages: all there\n'
    return
  fi
  if [[ $(id -u) != 0 ]]; then
    # At a terminal sudo may ask for the password (it talks to the terminal itself); elsewhere nobody could answer.
    if command -v sudo >/dev/null && { [[ -t 0 ]] || sudo -n true 2>/dev/null; }; then
      as_root=(sudo)
    else
      fail "packages are missing and this is neither root nor a user with sudo; as root, type:
  apt-get install --no-install-recommends ${missing[*]}"
    fi
  fi
  printf 'packages to install: %s\n' "${missing[*]}"
  local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -y -o DPkg::Lock::Timeout=300)
  # A source that cannot be read need not be one of those that matter here.
  mkdir -p "$logs"
  "${apt[@]}" -o APT::Update::Error-Mode=any update >"$logs/apt-update.log" 2>&1 </dev/null ||
    printf 'apt-get update could not read every source: %s\n' "$logs/apt-update.log"
  step "apt-get install" "$logs/apt-install.log" "${apt[@]}" install --no-install-recommends "${missing[@]}"
  grep -E '^(Need to get|After this operation)' "$logs/apt-install.log" | sed 's/^/    /' || true
}

# What the pages on static scans are made with; sets commit and cpu for them.
build_scan_suite() {
  local logs=build/scans/log tests=()
  install_missing "$logs" "${core_packages[@]}"
  [[ -f build/release/CMakeCache.txt ]] || tests=(-DTUBETRACK_TESTS=OFF)
  step "configure" "$logs/configure.log" cmake --preset release -DTUBETRACK_BENCH=ON "${tests[@]}"
  step "build (a few minutes at first)" "$logs/build.log" cmake --build --preset release --target scan_suite
  commit=$(git rev-parse --short HEAD 2>/dev/null || printf 'no repository')
  [[ -z $(git status --porcelain -uno -- ':!docs' 2>/dev/null) ]] || commit+=", with changes"
  cpu=$(sed -n 's/^model name[[:space:]]*: //p' /proc/cpuinfo | head -n 1)
  # A busy machine makes times longer: the page says how busy it was.
  cpu="${cpu:-unknown}, $(nproc) cores, load $(cut -d ' ' -f 1 /proc/loadavg) at the start"
}
