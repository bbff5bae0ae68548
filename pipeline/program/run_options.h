// Options of every command, and of every run over an output folder, besides those of stages.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/base/options.h"

namespace regrade {

struct ProgramOptions {
  int threads = 0;
  bool json = false;
  bool verbose = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("threads", threads,
         {.unit = "threads", .help = "0 uses one per core", .min = 0, .max = 4096});
    bind("json", json, {.help = "prints progress and results as lines of JSON on stdout"});
    bind(
        "verbose", verbose,
        {.help = "prints what was measured, too; it is always in the folder's log and report"});
  }
};

inline constexpr char kMaxMemoryHelp[] =
    "limit on planned memory, of 10^9 bytes; 0 takes what is free";

struct RunOptions {
  std::string out;
  std::string preset = "standard";
  std::string paper_config = "auto";
  std::string device = "auto";
  uint64_t seed = 0;
  int holdout = 8;
  std::string effects = "auto";
  double max_memory_gb = 0;
  bool reproducible = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out,
         {.help = "the output folder; the same command again continues what is in it; not of "
                  "commands that take DIR"});
    bind("preset", preset,
         {.help = "trade-off between accuracy and time; smoke only shows that everything runs",
          .choices = "smoke|draft|standard|paper|best"});
    bind("paper-config", paper_config,
         {.help = "of --preset paper: the configuration of Plenoxels' code. auto takes syn for "
                  "transparent photos, llff for forward-facing captures, else custom",
          .choices = "auto|syn|llff|tnt|custom",
          .constant = true});
    bind("device", device,
         {.help = "the processor for fits, restyling and frames; cuda:1 is the second card",
          .choices = "auto|cpu|cuda"});
    bind("seed", seed, {.help = "seed of all random numbers"});
    bind("holdout", holdout,
         {.unit = "photos",
          .help = "keeps every n-th photo, in the order of names, for measuring instead of "
                  "fitting; 0 fits all, and held-out metrics do not exist",
          .min = 0,
          .max = 1000});
    bind("effects", effects,
         {.help = "effects to model: auto measures whether each is needed; a list such as "
                  "ndc=off,exposure=on overrides that for ndc (of voxels), alpha, background, "
                  "exposure, view-dependence (of splats on) and pose-refinement; falloff=on "
                  "undoes what a lens darkens in the corners"});
    bind("max-memory", max_memory_gb,
         {.unit = "GB", .help = kMaxMemoryHelp, .min = 0, .max = 1e6});
    bind("reproducible", reproducible,
         {.help = "gives the same bytes for any number of threads and any interruption, from "
                  "finished poses on; slower. --device auto then means the CPU; with --device "
                  "cuda style-exact-sums is on, of voxels fit-exact-sums, too, and the bytes "
                  "are those of this card and build"});
  }
};

inline constexpr char kRequireHelp[] =
    "bounds of metrics, as styled:tc-psnr:1>=30,reconstruct:psnr-heldout>=25; where one does "
    "not hold, the exit status is 8; not where nothing is measured";

inline constexpr char kJUnitHelp[] =
    "writes the outcome of each bound of --require to this file, as JUnit XML for CI systems";

// Options of one start of the program; never part of a stage's inputs.
struct StartOptions {
  std::string config;
  std::string restart_from;
  std::string until = "report";
  std::string require, junit;
  bool dry_run = false;
  bool yes = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("config", config,
         {.help = "a run.json to take options and arguments from, or {\"NAME\": VALUE, ...} of "
                  "--help-constants, in a file or here. Flags override them",
          .once = true});
    bind("restart-from", restart_from,
         {.help = "repeats this stage and all later ones, even where they are done",
          .choices = "|pose|reconstruct|style_2d|stylize|render|evaluate|report",
          .once = true});
    bind(
        "until", until,
        {.help =
             "ends each style after this stage: render leaves out measuring and page; `regrade "
             "render` goes on",
         .choices = "stylize|render|evaluate|report",
         .once = true});
    bind("require", require, {.help = kRequireHelp, .once = true});
    bind("junit", junit, {.help = kJUnitHelp, .once = true});
    bind("dry-run", dry_run,
         {.help = "prints what would be done, and does nothing", .once = true});
    bind("yes", yes,
         {.help = "answers yes: fetches what --method pca-kd needs, and runs and reads what a "
                  "folder's run.json names outside of it",
          .once = true});
  }
};

}  // namespace regrade
