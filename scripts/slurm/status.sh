#!/bin/sh
# Prints the state of a Slurm job for Snakemake: running, success or failed.   status.sh JOB
state=$(scontrol --oneliner show job "$1" 2>/dev/null | sed -n 's/.* JobState=\([A-Z_]*\).*/\1/p')
# The scheduler drops jobs after some minutes; the accounting, if there is one, keeps them.
[ -n "$state" ] || state=$(sacct --noheader --parsable2 --format=State --jobs "$1" 2>/dev/null | head -n 1)
case $state in
  COMPLETED) echo success ;;
  PENDING | CONFIGURING | RUNNING | COMPLETING | SUSPENDED | REQUEUED | RESIZING | STOPPED) echo running ;;
  *) echo failed ;;
esac
