// Options of every command and of every run over an output folder.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/base/options.h"

namespace regrade {

struct ProgramOptions {
  int threads = 0;
  bool json = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("threads", threads,
         {.unit = "threads",
          .help = "how many run at once; 0: one per core",
          .min = 0,
          .max = 4096});
    bind("json", json, {.help = "prints progress and results as lines of JSON on stdout"});
  }
};

struct RunOptions {
  std::string out;
  std::string preset = "standard";
  std::string device = "auto";
  uint64_t seed = 0;
  int holdout = 8;
  std::string effects = "auto";
  double max_memory_gb = 0;
  bool reproducible = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the output folder; the same command again continues from it"});
    bind("preset", preset,
         {.help = "trades accuracy for time; single options override it",
          .choices = "draft|standard|paper|best"});
    bind("device", device,
         {.help = "processor of the computations", .choices = "auto|cpu|cuda"});
    bind("seed", seed, {.help = "of all random numbers"});
    bind("holdout", holdout,
         {.unit = "photos",
          .help = "of every so many photos, in the order of names, one is not fitted but kept "
                  "for measuring; 0 fits all photos and measures none",
          .min = 0,
          .max = 1000});
    bind(
        "effects", effects,
        {.help = "models of scene and camera: auto decides by measurement; ndc=on|off, "
                 "alpha=on|off, background=on|off, exposure=on|off, view-dependence=on|off and "
                 "pose-refinement=on|off, separated by commas, override single decisions"});
    bind("max-memory", max_memory_gb,
         {.unit = "GB",
          .help = "limits the memory that the run plans with; 0: the free memory",
          .min = 0,
          .max = 1e6});
    bind("reproducible", reproducible,
         {.help = "gives the same bytes for any number of threads and any interruption, from "
                  "finished poses on; slower"});
  }
};

// Options of one start of the program; never part of a stage's inputs.
struct StartOptions {
  std::string config;
  std::string restart_from;
  bool dry_run = false;
  bool break_lock = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("config", config, {.help = "a run.json; its options and arguments are used"});
    bind("restart-from", restart_from,
         {.help = "runs this stage and all later ones again, even if they are done",
          .choices = "|pose|reconstruct|style_2d|stylize|render|evaluate|report"});
    bind("dry-run", dry_run, {.help = "prints what would be done, and does nothing"});
    bind("break-lock", break_lock,
         {.help = "takes over a folder whose last run died on another machine"});
  }
};

}  // namespace regrade
