#!/bin/sh
# Job script of one run, written by `./talus batch`; edit it as you like, and submit it as often as you like:
# it goes on where the run is, and does nothing once all is done. Outside Slurm it runs with `sh` alone.
@SBATCH@
@SETUP@
set -u
run=@RUN@
programs=@PROGRAMS@
ranks=${SLURM_NTASKS:-@RANKS@}
go_on=@GO_ON@ # requeue: this job goes back into the queue; chain: the next job of the chain goes on

# mpirun kills its ranks twice this many seconds after a TERM; they need time for a checkpoint. Slurm itself kills what
# is left after its KillWait, 30 s unless set otherwise.
export OMPI_MCA_odls_base_sigkill_timeout=15

parallel() { exec @LAUNCHER@ -n "$ranks" "$@"; }

say() { echo "$(date -u +%Y-%m-%dT%H:%M:%SZ) job.sh: $*" >&2; }

# USR1 comes before the time limit and at a preemption, TERM before a kill. Both go on to mpirun as USR1, which it hands
# to every rank, and the ranks stop after a checkpoint.
child='' stopping=''
stop() {
    say "told to stop ($1)"
    stopping=$1
    [ -z "$child" ] || kill -s USR1 "$child" 2>/dev/null
}
trap 'stop USR1' USR1
trap 'stop TERM' TERM
trap 'stop INT' INT

# run_to_end WORD...: runs a program to its end, whatever signals come meanwhile; its status is left in $status.
run_to_end() {
    status=75
    [ -z "$stopping" ] || return 0
    "$@" &
    child=$!
    while kill -s 0 "$child" 2>/dev/null; do
        # A signal ends this wait, so it is answered at once.
        sleep 1 &
        wait $!
        # With CONTINUE written and LOCK gone the ranks are through, but mpirun goes on waiting: a second TERM makes it leave.
        if [ -f CONTINUE ] && [ ! -f LOCK ]; then
            kill -s TERM "$child" 2>/dev/null
        fi
    done
    status=0
    wait "$child" || status=$?
    child=''
}

# Cancels the jobs that wait with this same script: they would fail as well, or nobody wants them now.
cancel_the_rest() {
    [ "$go_on" = chain ] && [ -n "${SLURM_JOB_ID:-}" ] || return 0
    script=$(squeue --noheader --jobs="$SLURM_JOB_ID" --format=%o)
    squeue --noheader --user="$(id -un)" --states=PENDING --format='%A %o' | while read -r job command; do
        [ "$command" != "$script" ] || { say "job $job is cancelled" && scancel "$job"; }
    done
}

# give_up CODE WORD...: no job goes on.
give_up() {
    code=$1
    shift
    say "$*"
    cancel_the_rest
    exit "$code"
}

# What CONTINUE says of a key; nothing where there is no such file.
told() { sed -n "s/.*\"$1\": *\"\{0,1\}\([^\",}]*\).*/\1/p" CONTINUE 2>/dev/null; }

# Does Slurm itself put a job with code 75 back into the queue? It does so even with --no-requeue.
slurm_requeues() {
    [ -n "${SLURM_JOB_ID:-}" ] || return 1
    case ",$(scontrol show config | sed -n 's/^RequeueExit *= *//p')," in
    *,75,*) return 0 ;;
    esac
    return 1
}

# Ends this slice in such a way that another one follows.
next_slice() {
    stopped=75
    case $(told reason) in
    stop-file | steps) # a person's wish
        ! slurm_requeues || stopped=0
        give_up "$stopped" "stopped on request; submit this script again to go on"
        ;;
    esac
    if [ "$(told step)" = "$step_before" ]; then
        stands=$(($(cat log/standstill 2>/dev/null || echo 0) + 1))
        echo "$stands" >log/standstill
        [ "$stands" -lt 3 ] || give_up 70 "three slices in a row brought nothing: too short?"
    else
        rm -f log/standstill
    fi
    say "stopped at t = $(told time) s, step $(told step); the next slice goes on"
    if [ "$go_on" = chain ]; then
        ! slurm_requeues || stopped=0
    elif [ -n "${SLURM_JOB_ID:-}" ] && ! slurm_requeues; then
        scontrol requeue "$SLURM_JOB_ID" || say "cannot put the job back: submit this script again"
    fi
    exit "$stopped"
}

# may_go_on WHAT: after a failure with $status, returns where another slice may follow.
may_go_on() {
    case $status in
    2 | 65 | 70 | 73 | 76 | 126 | 127) give_up "$status" "$1 failed with exit code $status" ;;
    75) return 0 ;;
    esac
    # mpirun says 1 after TERM whatever the ranks say, and a signal that comes too early kills them.
    [ -f CONTINUE ] || [ -n "$stopping" ] || give_up "$status" "$1 failed with exit code $status"
}

cd "$run" || exit 73
mkdir -p log || exit 73
step_before=$(told step)

if [ ! -f scene.lock.toml ]; then
    if [ ! -f prepared/scene.lock.toml ]; then
        run_to_end parallel "$programs/sph-prep" scene.toml -o prepared
        [ "$status" = 0 ] || { may_go_on sph-prep && next_slice; }
    fi
    # The scene last: once it is there, so is all it needs.
    for file in initial.hdf provenance.json scene.lock.toml; do
        [ ! -f "prepared/$file" ] || mv -f "prepared/$file" . || exit 73
    done
    rm -rf prepared prepared.tmp-*
fi

# A scene that was changed since: sph-run takes up what may change, and refuses the rest.
changed=''
[ ! -f scene.toml ] || cmp -s scene.toml scene.lock.toml || changed=yes

if [ ! -f DONE ] || [ -n "$changed" ]; then
    rm -f CONTINUE
    run_to_end parallel "$programs/sph-run" "$run" ${changed:+--scene scene.toml}@OPTIONS@
    [ "$status" = 0 ] || { may_go_on sph-run && next_slice; }
    [ -f DONE ] || give_up 70 "sph-run ended without DONE"
fi

if [ -z "$(find log/evaluated -newer DONE 2>/dev/null)" ]; then
    run_to_end "$programs/sph-post" "$run"
    [ "$status" = 0 ] || { may_go_on sph-post && next_slice; }
    : >log/evaluated
fi
say "done: $run"
