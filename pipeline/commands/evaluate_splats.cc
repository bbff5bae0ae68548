#include "pipeline/commands/evaluate_splats.h"

#include <filesystem>
#include <optional>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/process/private_folder.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {
namespace {

// Before anything is rendered.
void RequireFile(const std::string& path) {
  if (std::filesystem::is_directory(path))
    throw InputError("is a folder, not a file of splats", path,
                     "give folders of frames with --frames and --reference");
  if (!std::filesystem::exists(path)) throw InputError("there is no such file", path);
}

void CheckSplats(const SplatsOptions& splats, const FramesOptions& frames) {
  if (frames.reference.empty())
    throw UsageError("styled splats are compared with those before styling", "--splats",
                     "add --reference FILE");
  for (const auto& [flag, given] :
       {std::pair{"--frames", !frames.frames.empty()}, {"--depth", !frames.depth.empty()}})
    if (given)
      throw UsageError("frames of --splats are rendered here", flag,
                       "leave it out, or evaluate the frames of OUT/rendered with it");
  for (const std::string& file : splats.splats) RequireFile(file);
  RequireFile(frames.reference);
}

}  // namespace

void EvaluateSplats(const SplatsOptions& splats, FramesOptions frames,
                    ConsistencyOptions options, bool has_mode, const Arguments& words,
                    Console* console) {
  CheckSplats(splats, frames);
  if (!has_mode) options.mode = "geometry";
  std::optional<PrivateFolder> unkept;
  if (frames.out.empty()) unkept.emplace();
  SplatFrames render{
      frames.reference, splats.splats,
      splats.views,     splats.background,
      splats.size,      (unkept ? unkept->path() : frames.out) + "/" + kRenderedFolder};
  const std::string inside = render.folder + "/";
  for (size_t k = 0; k < splats.splats.size(); ++k)
    frames.frames.push_back(inside + StyledName(k));
  frames.reference = inside + kReferenceFrames;
  if (options.mode == "geometry") {
    frames.cameras = inside + kFrameCameras;
    frames.depth = inside + kReferenceDepth;
  }
  EvaluateFrames(frames, options, words, console, [&] {
    std::optional<Workspace> locked;
    if (!unkept) locked.emplace(frames.out);
    std::filesystem::create_directories(render.folder);
    return RenderSplatFrames(render, console);
  });
}

}  // namespace regrade
