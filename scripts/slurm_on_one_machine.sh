#!/usr/bin/env bash
# A Slurm cluster of two nodes on one machine, to try workflows on: MUNGE, MariaDB, slurmdbd, slurmctld and two slurmd that go by different
# names. All its state lies below DIR, it needs neither systemd nor root, and what it starts it stops.
#
#   scripts/slurm_on_one_machine.sh start DIR      then: . DIR/environment
#   scripts/slurm_on_one_machine.sh node DIR N     starts the slurmd of node N (1 or 2) again, after it was killed
#   scripts/slurm_on_one_machine.sh stop DIR
#
# It installs nothing: on Debian and Ubuntu, apt-get install slurm-wlm slurmdbd mariadb-server munge. It listens at 127.0.0.1, at PORT (default
# 27800) and the five ports after it. A node has CPUS processors (default 2), whatever the machine has. A killed node is noticed in half a
# minute; its jobs are requeued (JobRequeue=1), and it is taken back when it returns (ReturnToService=2).
set -euo pipefail

usage() {
    sed -n '2,13s/^# \?//p' "$0"
    exit 2
}
[ $# -ge 2 ] || usage
command=$1 number=${3:-}
mkdir -p "$2"
dir=$(cd "$2" && pwd)
me=$(id -un)
: "${PORT:=27800}" "${CPUS:=2}"
# Debian has daemons where a user's PATH does not look.
PATH=$PATH:/usr/sbin:/sbin
export SLURM_CONF=$dir/slurm.conf

fail() {
    echo "$*" >&2
    exit 1
}

# Waits until a command succeeds.
wait_for() {
    local what=$1
    shift
    local end=$((SECONDS + 60))
    while [ $SECONDS -lt $end ]; do
        if timeout 10 "$@" >/dev/null 2>&1; then return; fi
        sleep 0.5
    done
    fail "$what does not answer after a minute: see $dir/log"
}

# Runs a program that stays in the foreground as a daemon; its process id goes to DIR/NAME.pid.
daemon() {
    local name=$1
    shift
    setsid "$@" >>"$dir/log/$name.out" 2>&1 </dev/null &
    echo $! >"$dir/$name.pid"
}

# A killed daemon may stay as a zombie, where nobody waits for it.
is_alive() { case $(ps -o state= -p "$1") in '' | Z*) return 1 ;; esac; }
is_running() { [ -f "$dir/$1.pid" ] && is_alive "$(cat "$dir/$1.pid")"; }

write_configuration() {
    local password memory
    password=$(od -An -N16 -tx1 /dev/urandom | tr -d ' \n')
    memory=$(awk '/^MemTotal/ { print int($2 / 1024) }' /proc/meminfo)
    mkdir -p "$dir"/{log,state,spool.node1,spool.node2}
    (umask 077 && head -c 1024 /dev/urandom >"$dir/munge.key")
    cat >"$dir/database.sql" <<END
CREATE DATABASE IF NOT EXISTS slurm_acct_db;
CREATE OR REPLACE USER 'slurm'@'127.0.0.1' IDENTIFIED BY '$password';
GRANT ALL ON slurm_acct_db.* TO 'slurm'@'127.0.0.1';
END
    cat >"$dir/slurmdbd.conf" <<END
AuthType=auth/munge
AuthInfo=socket=$dir/munge.sock
DbdHost=localhost
DbdAddr=127.0.0.1
DbdPort=$((PORT + 1))
SlurmUser=$me
PidFile=$dir/slurmdbd.own.pid
LogFile=$dir/log/slurmdbd.log
StorageType=accounting_storage/mysql
StorageHost=127.0.0.1
StoragePort=$PORT
StorageUser=slurm
StoragePass=$password
StorageLoc=slurm_acct_db
END
    chmod 600 "$dir/slurmdbd.conf" "$dir/database.sql"
    cat >"$dir/slurm.conf" <<END
ClusterName=reprobe
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=$((PORT + 2))
SlurmUser=$me
SlurmdUser=$me
AuthType=auth/munge
# A requeued job waits until its first credential has expired: two minutes otherwise.
AuthInfo=socket=$dir/munge.sock,cred_expire=20
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool.%n
SlurmctldPidFile=$dir/slurmctld.own.pid
SlurmdPidFile=$dir/slurmd.%n.own.pid
SlurmctldLogFile=$dir/log/slurmctld.log
SlurmdLogFile=$dir/log/slurmd.%n.log
MpiDefault=none
# No control groups: containers and test machines often have none to give.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/slurmdbd
AccountingStorageHost=127.0.0.1
AccountingStoragePort=$((PORT + 1))
AccountingStoragePass=$dir/munge.sock
# What a job is for, by Snakemake.
AccountingStoreFlags=job_comment
JobRequeue=1
ReturnToService=2
SlurmdTimeout=20
SlurmctldTimeout=20
BatchStartTimeout=20
KillWait=5
MinJobAge=600
SchedulerParameters=sched_interval=5
# The machine has fewer processors than its nodes together.
SlurmdParameters=config_overrides
NodeName=node1 NodeHostname=node1 NodeAddr=127.0.0.1 Port=$((PORT + 3)) CPUs=$CPUS RealMemory=$memory State=UNKNOWN
NodeName=node2 NodeHostname=node2 NodeAddr=127.0.0.1 Port=$((PORT + 4)) CPUs=$CPUS RealMemory=$memory State=UNKNOWN
PartitionName=main Nodes=node1,node2 Default=YES MaxTime=INFINITE DefMemPerCPU=100 OverSubscribe=NO State=UP
END
}

start_node() { daemon "slurmd.node$1" slurmd -D -N "node$1" -f "$SLURM_CONF"; }

start() {
    local missing=()
    for program in munged:munge mariadbd:mariadb-server slurmdbd:slurmdbd slurmctld:slurm-wlm slurmd:slurm-wlm sbatch:slurm-wlm; do
        command -v "${program%:*}" >/dev/null || missing+=("${program#*:}")
    done
    [ ${#missing[@]} = 0 ] || fail "missing: $(printf '%s\n' "${missing[@]}" | sort -u | tr '\n' ' ')(apt-get install slurm-wlm slurmdbd mariadb-server munge)"
    ! is_running slurmctld || fail "$dir: runs already"
    write_configuration
    daemon munged munged --foreground --force --socket="$dir/munge.sock" --key-file="$dir/munge.key" --pid-file="$dir/munged.own.pid" \
        --log-file="$dir/log/munged.log" --seed-file="$dir/munge.seed"
    wait_for munged munge -n --socket="$dir/munge.sock"
    if [ ! -d "$dir/mysql/mysql" ]; then
        mariadb-install-db --no-defaults --datadir="$dir/mysql" --user="$me" --auth-root-authentication-method=socket \
            --auth-root-socket-user="$me" --skip-test-db >"$dir/log/mariadb-install.log" 2>&1 || fail "mariadb-install-db: see $dir/log/mariadb-install.log"
    fi
    daemon mariadbd mariadbd --no-defaults --datadir="$dir/mysql" --user="$me" --socket="$dir/mysql.sock" --pid-file="$dir/mariadbd.own.pid" \
        --bind-address=127.0.0.1 --port="$PORT" --innodb-buffer-pool-size=256M --innodb-lock-wait-timeout=900
    local client=(mariadb --no-defaults --socket="$dir/mysql.sock" --user=root)
    [ "$me" = root ] || client=(mariadb --no-defaults --socket="$dir/mysql.sock" --user="$me")
    wait_for MariaDB "${client[@]}" -e 'SELECT 1'
    "${client[@]}" <"$dir/database.sql"
    # slurmdbd looks for its configuration beside slurm.conf.
    daemon slurmdbd slurmdbd -D
    wait_for slurmdbd sacctmgr -n -i show cluster
    sacctmgr -n -i add cluster reprobe >/dev/null 2>&1 || true
    daemon slurmctld slurmctld -D -f "$SLURM_CONF"
    wait_for slurmctld scontrol ping
    start_node 1
    start_node 2
    wait_for "a node, or both," sh -c '[ "$(sinfo -h -N -t idle -o %N | sort -u | wc -l)" = 2 ]'
    sinfo -N
    # Snakemake's executor takes SLURM_CONF away from the srun within its jobs.
    mkdir -p "$dir/bin"
    printf '#!/bin/sh\nSLURM_CONF=%q exec %q "$@"\n' "$SLURM_CONF" "$(command -v srun)" >"$dir/bin/srun"
    chmod +x "$dir/bin/srun"
    printf 'export SLURM_CONF=%q PATH=%q:$PATH\n' "$SLURM_CONF" "$dir/bin" >"$dir/environment"
    echo ". $dir/environment"
}

stop() {
    local name pid
    # Jobs first: their steps are children of no daemon.
    if is_running slurmctld; then
        timeout 20 scancel -u "$me" 2>/dev/null || true
        sleep 2
    fi
    for name in slurmd.node1 slurmd.node2 slurmctld slurmdbd mariadbd munged; do
        [ -f "$dir/$name.pid" ] || continue
        pid=$(cat "$dir/$name.pid")
        kill "$pid" 2>/dev/null || true
        for _ in $(seq 60); do
            is_alive "$pid" || break
            sleep 0.5
        done
        ! is_alive "$pid" || kill -9 "$pid"
        rm -f "$dir/$name.pid"
    done
}

case $command in
start) start ;;
stop) stop ;;
node)
    case $number in 1 | 2) ;; *) usage ;; esac
    ! is_running "slurmd.node$number" || fail "node$number runs already"
    start_node "$number"
    ;;
*) usage ;;
esac
