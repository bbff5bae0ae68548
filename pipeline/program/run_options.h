// What every command, and every run over an output folder, can be told besides its stages'
// options.
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
         {.unit = "threads", .help = "0 takes one a core", .min = 0, .max = 4096});
    bind("json", json, {.help = "progress and results as lines of JSON on stdout"});
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
    bind("out", out, {.help = "the output folder; the same command again goes on from it"});
    bind("preset", preset,
         {.help = "a point on the curve of accuracy over time; single options override it",
          .choices = "draft|standard|paper|best"});
    bind("device", device, {.help = "where arithmetic runs", .choices = "auto|cpu|cuda"});
    bind("seed", seed, {.help = "draws everything that is random"});
    bind("holdout", holdout,
         {.unit = "photos",
          .help = "every so many photos, in the order of names, one is kept for measuring; 0 "
                  "fits all, and no held-out figure exists",
          .min = 0,
          .max = 1000});
    bind(
        "effects", effects,
        {.help = "what the scene calls for is decided by measurement (auto); ndc=on|off, "
                 "alpha=on|off, background=on|off, exposure=on|off, view-dependence=on|off and "
                 "pose-refinement=on|off, with commas between, decide instead"});
    bind("max-memory", max_memory_gb,
         {.unit = "GB",
          .help = "memory to plan with; 0 takes what is free",
          .min = 0,
          .max = 1e6});
    bind("reproducible", reproducible,
         {.help = "same bytes for any number of threads and any interruption, from finished "
                  "poses on; slower"});
  }
};

// How this one start behaves; never part of a stage's inputs.
struct StartOptions {
  std::string config;
  std::string restart_from;
  bool dry_run = false;
  bool break_lock = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("config", config, {.help = "a run.json whose options and arguments are taken"});
    bind("restart-from", restart_from,
         {.help = "do this stage and the later ones again, whatever is there",
          .choices = "|pose|reconstruct|style_2d|stylize|render|evaluate|report"});
    bind("dry-run", dry_run, {.help = "say what would be done, and do nothing"});
    bind("break-lock", break_lock,
         {.help = "take over a folder whose last run died on another machine"});
  }
};

}  // namespace regrade
