#!/usr/bin/env bash
# Starts a Slurm of one node on this machine, runs a command in it, waits for the jobs that the command submitted,
# and stops everything again. Use it to try a job array before it goes to a cluster.
#
#   one-machine.sh ./submit.sh runs/campaign scenarios/quickstart.toml --runs 21
#   one-machine.sh bash                                    # a shell in which sbatch, squeue and scancel work
#
# It needs Debian's or Ubuntu's packages slurmctld, slurmd, slurm-client and munge, but no systemd, no cgroups and no
# dbus, so it works in a container. Configuration, state, logs and sockets are in a temporary folder and the ports are free
# ones, so that /etc/slurm is not touched and several of these run beside each other.
# It ends with the status of the command, or with 1 if a job failed.
set -euo pipefail

say() { echo "one-machine.sh: $*" >&2; }

if [ $# -eq 0 ]; then
  say "no command; for example: one-machine.sh bash"
  exit 2
fi
PATH="$PATH:/usr/sbin"
for program in munged slurmctld slurmd sbatch squeue sinfo scancel; do
  if ! command -v "$program" >/dev/null; then
    say "no $program here; apt-get install slurmctld slurmd slurm-client munge"
    exit 2
  fi
done

folder=$(mktemp -d "${TMPDIR:-/tmp}/slurm.XXXXXX")
export SLURM_CONF="$folder/slurm.conf"
command_pid=""
daemons=() # in the order of their start

# Lists the jobs that are still running or waiting.
jobs_left() { timeout 60 squeue --noheader --array --format=%i; }

is_running() { kill -0 "$1" 2>/dev/null; }

take_down() {
  trap '' INT TERM HUP # a second Ctrl-C does not leave half of it running
  if [ -n "$command_pid" ] && is_running "$command_pid"; then
    kill "$command_pid" 2>/dev/null || true
  fi
  # jobs are not children of slurmd: they would go on without it
  if [ "${#daemons[@]}" -eq 3 ] && is_running "${daemons[1]}"; then
    local left
    for _ in $(seq 100); do
      left=$(jobs_left 2>/dev/null) || break
      [ -n "$left" ] || break
      xargs timeout 10 scancel 2>/dev/null <<<"$left" || true
      sleep 0.2
    done
  fi
  local i
  for ((i = ${#daemons[@]} - 1; i >= 0; i--)); do
    kill "${daemons[i]}" 2>/dev/null || continue
    for _ in $(seq 50); do
      is_running "${daemons[i]}" || break
      sleep 0.1
    done
    kill -KILL "${daemons[i]}" 2>/dev/null || true
    wait "${daemons[i]}" 2>/dev/null || true
  done
  rm -rf "$folder"
}
trap take_down EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
trap 'exit 129' HUP

# Starts a daemon without a terminal, so that Ctrl-C does not end it before its jobs. The kernel ends it with this script.
daemon() {
  setsid setpriv --pdeathsig KILL "$@" >"$folder/$(basename "$1").out" 2>&1 </dev/null &
  daemons+=($!)
}

# An unused port among the 6000 after the given one, below the range that the kernel gives to clients.
free_port() {
  local port=$(($1 + RANDOM % 6000))
  while (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null; do
    port=$(($1 + RANDOM % 6000))
  done
  echo "$port"
}

name=$(uname -n)
name=${name%%.*}
user=$(id -un)
memory=$(awk '/^MemTotal:/ { print int($2 / 1024) }' /proc/meminfo)
mkdir "$folder/state" "$folder/spool"
cat >"$SLURM_CONF" <<CONF
ClusterName=one-machine
SlurmctldHost=$name(127.0.0.1)
SlurmctldPort=$(free_port 20000)
SlurmdPort=$(free_port 26000)
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
# use the processors that this script may use, whatever slurmd finds
SlurmdParameters=config_overrides
ReturnToService=2
KillWait=2
# keep finished jobs in the list, so that this script can read how they ended
MinJobAge=1000000
SchedulerParameters=sched_interval=2,bf_interval=2
NodeName=$name NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$memory State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF

# slurmd looks for cgroups even if nothing uses them; this switches that off. Versions before 23.02 have no such
# setting, but their plugin for cgroups v1 does not look before it is used.
case $(slurmd -V) in
  *' 21.'* | *' 22.'*) cgroup=cgroup/v1 ;;
  *) cgroup=disabled ;;
esac
echo "CgroupPlugin=$cgroup" >"$folder/cgroup.conf"

(umask 077 && head -c 128 /dev/urandom >"$folder/munge.key")
# --force: nobody else uses this socket, so its folder need not be open to all
daemon munged --foreground --force --num-threads=2 --key-file="$folder/munge.key" --socket="$folder/munge.socket" \
  --pid-file="$folder/munged.pid" --seed-file="$folder/munged.seed" --log-file="$folder/munged.log"
for _ in $(seq 100); do
  [ ! -S "$folder/munge.socket" ] || break
  sleep 0.1
done
daemon slurmctld -D -f "$SLURM_CONF"
daemon slurmd -D -f "$SLURM_CONF"

deadline=$((SECONDS + 60))
until [ "$(timeout 5 sinfo --noheader --format=%T 2>/dev/null)" = idle ]; do
  for pid in "${daemons[@]}"; do
    is_running "$pid" || deadline=0
  done
  if [ "$SECONDS" -ge "$deadline" ]; then
    say "Slurm does not come up:"
    tail -n 20 "$folder"/*.log >&2
    exit 1
  fi
  sleep 0.2
done
say "Slurm $(sinfo --version | cut -d' ' -f2) on $name: $(nproc) cores"

# in the background, because bash delays its traps until a command in the foreground ends
env --default-signal=INT,QUIT "$@" <&0 &
command_pid=$!
status=0
wait "$command_pid" || status=$?
command_pid=""

left=$(jobs_left)
if [ -n "$left" ]; then
  say "waiting for $(wc -l <<<"$left") jobs; Ctrl-C cancels them"
fi
while [ -n "$left" ]; do
  sleep 0.5
  left=$(jobs_left)
done
jobs=$(squeue --noheader --array --states=all --format='%i %j %T')
failed=$(grep -v ' COMPLETED$' <<<"$jobs" | sort -V) || true
if [ -n "$jobs" ] && [ -n "$failed" ]; then
  say "not completed:"
  echo "$failed" >&2
  [ "$status" -ne 0 ] || status=1
fi
exit "$status"
