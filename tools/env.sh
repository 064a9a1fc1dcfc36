# Sourced by the scripts beside it: the system's python before any other, the built package, and a
# ROS master of its own, so that nothing meets another ROS session on this machine.
ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
export PATH=/usr/bin:/bin:$PATH
# A user's own python packages would shadow the system's.
export PYTHONNOUSERSITE=1
if [ -f "$ROOT/build/devel/setup.bash" ]; then
  set +u
  # shellcheck disable=SC1091
  . "$ROOT/build/devel/setup.bash"
  set -u
fi
export ROS_HOSTNAME=localhost
unset ROS_IP
ROS_PORT=$(python3 -c 'import socket; s = socket.socket(); s.bind(("", 0)); print(s.getsockname()[1])')
export ROS_MASTER_URI=http://localhost:$ROS_PORT
