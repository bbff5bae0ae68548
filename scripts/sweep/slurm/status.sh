#!/bin/sh
# What became of a Slurm job, in Snakemake's words: running, success or failed.
state=$(scontrol --oneliner show job "$1" 2>/dev/null | sed -n 's/.* JobState=\([A-Z_]*\).*/\1/p')
# The scheduler forgets jobs after some minutes; the accounting, where there is one, does not.
[ -n "$state" ] || state=$(sacct --noheader --parsable2 --format=State --jobs "$1" 2>/dev/null | head -n 1)
case $state in
  COMPLETED) echo success ;;
  PENDING | CONFIGURING | RUNNING | COMPLETING | SUSPENDED | REQUEUED | RESIZING | STOPPED) echo running ;;
  *) echo failed ;;
esac
