#include "pipeline/commands/given_geometry.h"

#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/frame_pairing.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/images/depth_map.h"

namespace regrade {
namespace {

std::string SizeText(int64_t width, int64_t height) {
  return Concat(width, " x ", height, " px");
}

// For each frame the index of what belongs to it. `where` is the file or folder of `names`.
std::vector<int> PartnersOf(const FrameFolder& reference, const std::vector<std::string>& names,
                            const std::string& what, const std::string& where,
                            std::vector<std::string>* notices) {
  const NamePairs pairs = PairNames(reference.names, names);
  for (size_t i = 0; i < pairs.partner.size(); ++i)
    if (pairs.partner[i] < 0)
      throw InputError("there is no " + what + " of " + reference.names[i], where,
                       "every frame of --reference needs one");
  if (pairs.by == "order") {
    if (names.size() != reference.names.size())
      throw InputError(Concat(names.size(), " of ", what, ", the reference has ",
                              reference.names.size(), " frames"),
                       where, "name them as the frames of --reference");
    notices->push_back(where + ": each " + what + " was taken in the order of names, " +
                       names.front() + " for " + reference.names.front() + " to " +
                       names.back() + " for " + reference.names.back());
  }
  return pairs.partner;
}

std::vector<Camera> CamerasOf(const std::string& poses, const FrameFolder& reference,
                              std::vector<std::string>* notices) {
  const TransformsFile file =
      ReadTransformsJson(poses, [&](const std::string&, int* width, int* height) {
        *width = reference.width;
        *height = reference.height;
      });
  std::vector<std::string> names;
  for (const TransformsFrame& frame : file.frames)
    names.push_back(std::filesystem::path(frame.file).filename().string());
  std::vector<Camera> cameras;
  for (const int i : PartnersOf(reference, names, "camera", poses, notices)) {
    const Camera& camera = file.frames[static_cast<size_t>(i)].camera;
    if (camera.width != reference.width || camera.height != reference.height)
      throw InputError("the camera of " + names[static_cast<size_t>(i)] + " is of " +
                           SizeText(camera.width, camera.height) + ", the frames of " +
                           SizeText(reference.width, reference.height),
                       poses, "give cameras of the frames' size");
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace

GeometrySource GivenGeometry(const std::string& poses, const std::string& depth,
                             const FrameFolder& reference, std::vector<std::string>* notices) {
  std::vector<std::string> names, files, paths;
  for (const ListedFile& file : ListFolder(depth).files) {
    if (!file.problem.empty())
      throw InputError("a depth map cannot be opened: " + file.problem,
                       depth + "/" + file.name);
    names.push_back(file.name);
    files.push_back(file.path);
  }
  if (names.empty()) throw InputError("there are no depth maps here", depth);
  for (const int i : PartnersOf(reference, names, "depth map", depth, notices))
    paths.push_back(files[static_cast<size_t>(i)]);
  return [paths, cameras = CamerasOf(poses, reference, notices)](int i) -> FrameGeometry {
    const Camera& camera = cameras[static_cast<size_t>(i)];
    return {DepthAlongRays(camera, ReadDepthMap(paths[static_cast<size_t>(i)], camera.width,
                                                camera.height)),
            camera};
  };
}

}  // namespace regrade
