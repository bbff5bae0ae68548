#include "pipeline/capture/capture_source.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/natural_order.h"
#include "pipeline/capture/nsvf_cameras.h"
#include "pipeline/capture/transforms_json.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kTrainTransforms[] = "transforms_train.json";
constexpr char kTestTransforms[] = "transforms_test.json";

bool HoldsModel(const fs::path& folder) {
  for (const char* ending : {".bin", ".txt"})
    if (fs::is_regular_file(folder / (std::string("cameras") + ending)) &&
        fs::is_regular_file(folder / (std::string("images") + ending)))
      return true;
  return false;
}

// The deepest folder that holds all pictures of the frames.
fs::path CommonFolder(const fs::path& folder, const std::vector<TransformsFrame>& frames) {
  fs::path common;
  for (const TransformsFrame& frame : frames) {
    const fs::path parent = fs::weakly_canonical(folder / frame.file).parent_path();
    if (common.empty()) {
      common = parent;
      continue;
    }
    fs::path shared;
    for (auto a = common.begin(), b = parent.begin();
         a != common.end() && b != parent.end() && *a == *b; ++a, ++b)
      shared /= *a;
    common = shared;
  }
  return common;
}

// Where the pictures are; empty if there is no such folder.
fs::path PictureFolder(const fs::path& root) {
  for (const char* name : {"images", "rgb", "image"})
    if (fs::is_directory(root / name)) return root / name;
  std::vector<std::string> names;
  std::error_code error;  // the caller reports a folder that cannot be listed
  for (fs::directory_iterator it(root, error), end; !error && it != end; it.increment(error))
    if (const std::string name = it->path().filename().string();
        name.starts_with("images_") && fs::is_directory(it->path(), error))
      names.push_back(name);
  std::ranges::sort(names, NaturalLess);
  return names.empty() ? fs::path() : root / names[0];
}

// A Blender capture whose second file names photos for tests.
CaptureSource WithTests(const fs::path& root, const fs::path& file, const TransformsFile& poses,
                        const fs::path& test_file, const TransformsFile& tests) {
  std::vector<TransformsFrame> frames = poses.frames;
  frames.insert(frames.end(), tests.frames.begin(), tests.frames.end());
  const fs::path photos = CommonFolder(root, frames);
  CaptureSource source{CaptureKind::kTransforms, photos.string(), file.string()};
  source.test_poses = test_file.string();
  const auto name = [&](const TransformsFrame& frame) {
    return fs::weakly_canonical(root / frame.file).lexically_relative(photos).generic_string();
  };
  for (const TransformsFrame& frame : frames) source.only.insert(name(frame));
  for (const TransformsFrame& frame : tests.frames) source.test.insert(name(frame));
  for (const TransformsFrame& frame : poses.frames)
    if (source.test.contains(name(frame)))
      throw InputError("\"" + frame.file + "\" is for training and for tests",
                       test_file.string(), "list it in one of the two files");
  return source;
}

CaptureSource NsvfSource(const fs::path& root, const fs::path& poses,
                         const fs::path& pictures) {
  CaptureSource source{CaptureKind::kNsvf, pictures.string(), poses.string()};
  source.intrinsics = (root / "intrinsics.txt").string();
  if (fs::is_regular_file(root / "bbox.txt")) source.box = (root / "bbox.txt").string();
  std::vector<std::string> names;
  std::error_code error;  // ingest reports a folder that cannot be listed
  for (fs::directory_iterator it(pictures, error), end; !error && it != end;
       it.increment(error))
    names.push_back(it->path().filename().string());
  NsvfSplit split = SplitNsvf(names);
  source.only = std::move(split.only);
  source.test = std::move(split.test);
  return source;
}

}  // namespace

bool LacksPoints(CaptureKind kind) {
  return kind == CaptureKind::kTransforms || kind == CaptureKind::kLlff ||
         kind == CaptureKind::kNsvf || kind == CaptureKind::kDtu;
}

CaptureSource DetectCapture(const std::string& folder) {
  std::error_code error;
  const fs::path root = fs::canonical(folder, error);
  if (error) throw InputError(error.message(), folder, "name a folder of photos, or a film");
  if (fs::is_regular_file(root)) return {CaptureKind::kPhotos, root.string(), ""};
  if (!fs::is_directory(root))
    throw InputError("is neither a folder nor a film", folder, "name a folder or a file");
  for (const char* name : {"transforms.json", kTrainTransforms}) {
    const fs::path file = root / name;
    if (!fs::is_regular_file(file)) continue;
    const auto unknown_size = [](const std::string&, int* width, int* height) {
      *width = *height = 0;
    };
    TransformsFile poses = ReadTransformsJson(file.string(), unknown_size);
    const fs::path test = root / kTestTransforms;
    if (name == std::string(kTrainTransforms) && fs::is_regular_file(test)) {
      const TransformsFile tests = ReadTransformsJson(test.string(), unknown_size, true);
      if (!tests.frames.empty()) return WithTests(root, file, poses, test, tests);
    }
    return {CaptureKind::kTransforms, CommonFolder(root, poses.frames).string(), file.string()};
  }
  const fs::path pictures = PictureFolder(root);
  if (!pictures.empty() && fs::is_regular_file(root / "intrinsics.txt"))
    for (const char* name : {"pose", "poses"})
      if (fs::is_directory(root / name)) return NsvfSource(root, root / name, pictures);
  if (!pictures.empty())
    for (const char* name : {"cameras.npz", "cameras_sphere.npz"})
      if (fs::is_regular_file(root / name))
        return {CaptureKind::kDtu, pictures.string(), (root / name).string()};
  if (fs::is_regular_file(root / "poses_bounds.npy"))
    return {CaptureKind::kLlff, (pictures.empty() ? root : pictures).string(),
            (root / "poses_bounds.npy").string()};
  for (const fs::path& poses : {root / "poses", root})
    if (fs::is_regular_file(poses / "photos.json") && HoldsModel(poses / "sparse"))
      return {CaptureKind::kPosed, (poses / "photos").string(), (poses / "sparse").string()};
  if (!pictures.empty())
    for (const char* model : {"sparse", "sparse/0"})
      if (HoldsModel(root / model))
        return {CaptureKind::kColmap, pictures.string(), (root / model).string()};
  return {CaptureKind::kPhotos, root.string(), ""};
}

}  // namespace regrade
