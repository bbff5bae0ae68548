#include "pipeline/commands/given_geometry.h"

#include <cstring>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/frame_pairing.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/files/npy_header.h"

namespace regrade {
namespace {

constexpr uint64_t kMostBytes = uint64_t{2} << 30;  // of a depth map

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

template <typename T>
void CopyDepth(const char* from, Image* depth) {
  for (float& value : depth->pixels) {
    T element;
    std::memcpy(&element, from, sizeof element);
    from += sizeof element;
    value = static_cast<float>(element);
  }
}

Image ReadDepth(const std::string& path, int width, int height) {
  const std::string bytes = ReadWholeFile(path, kMostBytes);
  const NpyHeader header = ParseNpyHeader(bytes, path);
  const auto& shape = header.shape;
  const bool flat = shape.size() == 2 || (shape.size() == 3 && shape[2] == 1);
  if (!flat || (header.type != ArrayType::kF32 && header.type != ArrayType::kF64))
    throw InputError("the depth map is no array [height, width] of float32 or float64", path,
                     "write it with numpy.save");
  if (shape[0] != height || shape[1] != width)
    throw InputError("the depth map is " + SizeText(shape[1], shape[0]) + ", the frames " +
                         SizeText(width, height),
                     path, "render it at the frames' size");
  if (bytes.size() < header.data_offset + header.data_bytes)
    throw InputError(Concat("the file ends after ", bytes.size(), " of ",
                            header.data_offset + header.data_bytes, " bytes"),
                     path);
  Image depth(width, height, 1);
  if (header.type == ArrayType::kF32)
    CopyDepth<float>(bytes.data() + header.data_offset, &depth);
  else
    CopyDepth<double>(bytes.data() + header.data_offset, &depth);
  return depth;
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
    return {DepthAlongRays(
                camera, ReadDepth(paths[static_cast<size_t>(i)], camera.width, camera.height)),
            camera};
  };
}

}  // namespace regrade
