// Reads the three files of a COLMAP model: little-endian records without padding, preceded by a
// count (format: colmap/src/colmap/scene/reconstruction_io.cc). COLMAP's own reader hangs or
// aborts on damaged files and accepts NaN poses.
#include "reconstruct/colmap/colmap_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <set>

#include "kernels/base/checked_math.h"
#include "kernels/base/error.h"
#include "kernels/scene/camera_checks.h"
#include "reconstruct/colmap/colmap_text.h"

namespace regrade {
namespace {

static_assert(std::endian::native == std::endian::little, "the files are little-endian");

constexpr size_t kLongestName = 4096;
constexpr uint64_t kSmallestImage = 4 + 7 * 8 + 4 + 1 + 8;  // bytes
constexpr int64_t kLargestSide = 1 << 18;                   // pixels
constexpr int32_t kLargestNewLens = 999;                    // beyond, a file is rather damaged
constexpr double kLargestCoordinate = 1e12;                 // world units
constexpr double kQuaternionTolerance = 1e-3;               // rounding in other programs

constexpr const char* kDamagedHint =
    "the file is damaged or was not written to its end; let COLMAP write the model again";

// A file in memory with a read position; every read checks the remaining bytes.
class Reader {
 public:
  // Reads `folder`/`name`.bin or, if it does not exist, the text file.
  Reader(const std::string& folder, const std::string& name)
      : path_(folder + "/" + name + ".bin") {
    std::ifstream file(path_, std::ios::binary | std::ios::ate);
    const bool text = !file;
    if (text) file.open(folder + "/" + name + ".txt", std::ios::binary | std::ios::ate);
    if (!file)
      throw InputError("cannot open it", path_,
                       "a COLMAP model needs cameras, images and points3D, as .bin or .txt");
    bytes_.resize(std::max<std::streamoff>(0, file.tellg()));
    file.seekg(0);
    if (!bytes_.empty() &&
        !file.read(bytes_.data(), static_cast<std::streamsize>(bytes_.size())))
      throw InputError("cannot read it", path_);
    if (!text) return;
    path_ = folder + "/" + name + ".txt";
    bytes_ = BinaryOfColmapText(name, bytes_, path_);
  }

  template <typename T>
  T Read(const char* what) {
    T value;
    if (Left() < sizeof(T)) Fail(std::string("the file ends inside ") + what);
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }

  double ReadFinite(const char* what) {
    const double value = Read<double>(what);
    if (!std::isfinite(value)) Fail(std::string(what) + " is not a finite number");
    return value;
  }

  // A count of records that take at least `smallest` bytes each.
  size_t ReadCount(const char* what, uint64_t smallest) {
    const uint64_t count = Read<uint64_t>("a count");
    const auto needed = CheckedMul(count, smallest);
    if (!needed || *needed > Left())
      Fail(
          Concat("the count of ", what, " is ", count, ", but only ", Left(), " bytes follow"));
    return static_cast<size_t>(count);
  }

  std::string ReadName() {
    const size_t longest = std::min(Left(), kLongestName + 1);
    const char* begin = bytes_.data() + position_;
    const void* end = std::memchr(begin, 0, longest);
    if (end == nullptr)
      Fail(longest > kLongestName ? "an image name is longer than 4096 bytes"
                                  : "the file ends inside an image name");
    std::string name(begin, static_cast<const char*>(end));
    position_ += name.size() + 1;
    return name;
  }

  void ExpectEnd() const {
    if (Left() > 0) Fail(std::to_string(Left()) + " bytes follow after the last record");
  }

  const std::string& path() const { return path_; }

  [[noreturn]] void Fail(const std::string& why) const {
    throw InputError(Concat(why, ", at byte ", position_), path_, kDamagedHint);
  }

 private:
  size_t Left() const { return bytes_.size() - position_; }

  std::string path_, bytes_;
  size_t position_ = 0;
};

std::string CameraText(uint32_t id) { return "camera " + std::to_string(id); }

std::vector<ColmapCamera> ReadCameras(const std::string& folder) {
  Reader reader(folder, "cameras");
  const size_t count = reader.ReadCount("cameras", 4 + 4 + 8 + 8 + 3 * 8);
  std::vector<ColmapCamera> cameras(count);
  for (ColmapCamera& camera : cameras) {
    camera.id = reader.Read<uint32_t>("a camera");
    const int32_t lens = reader.Read<int32_t>("a camera");
    if (lens < 0 || lens >= kNumColmapLenses) {
      const std::string unknown =
          Concat(CameraText(camera.id), " has the unknown camera model ", lens);
      if (lens < 0 || lens > kLargestNewLens) reader.Fail(unknown);
      RefuseNewerLens(unknown, reader.path());
    }
    camera.lens = static_cast<ColmapLens>(lens);
    const ColmapLensInfo& info = InfoOf(camera.lens);
    if (info.focals == 0)
      throw InputError(CameraText(camera.id) + " has the camera model " + info.name +
                           ", which is not supported",
                       reader.path(),
                       "run colmap image_undistorter, or pose the photos with OPENCV or "
                       "OPENCV_FISHEYE");
    Camera& c = camera.intrinsics;
    const uint64_t width = reader.Read<uint64_t>("a camera");
    const uint64_t height = reader.Read<uint64_t>("a camera");
    if (width < 1 || height < 1 || width > kLargestSide || height > kLargestSide)
      reader.Fail(
          Concat(CameraText(camera.id), " has the picture size ", width, " x ", height));
    c.width = static_cast<int>(width);
    c.height = static_cast<int>(height);
    c.fx = reader.ReadFinite("a focal length");
    c.fy = info.focals == 2 ? reader.ReadFinite("a focal length") : c.fx;
    c.cx = reader.ReadFinite("a principal point");
    c.cy = reader.ReadFinite("a principal point");
    c.lens = info.lens;
    for (int i = 0; i < info.coefficients; ++i)
      c.distortion[i] = reader.ReadFinite("a distortion coefficient");
    const std::string implausible = ImplausibleCamera(c);
    if (!implausible.empty()) reader.Fail(CameraText(camera.id) + " has " + implausible);
  }
  reader.ExpectEnd();
  return cameras;
}

double ReadCoordinate(Reader& reader, const char* what) {
  const double value = reader.ReadFinite(what);
  if (std::abs(value) > kLargestCoordinate) reader.Fail(std::string(what) + " is at infinity");
  return value;
}

Vec3d ReadVector(Reader& reader, const char* what) {
  Vec3d v;
  for (int i = 0; i < 3; ++i) v[i] = ReadCoordinate(reader, what);
  return v;
}

Mat3d ReadRotation(Reader& reader, uint32_t image_id) {
  double wxyz[4];
  for (double& component : wxyz) component = reader.ReadFinite("a quaternion");
  const Eigen::Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  const double norm = q.norm();
  if (!(std::abs(norm - 1) <= kQuaternionTolerance))
    reader.Fail(Format("image %u has a rotation quaternion of length %g", image_id, norm));

  Mat3d rotation;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&rotation(0, 0)) =
      q.normalized().toRotationMatrix();
  return rotation;
}

std::vector<ColmapImage> ReadImages(const std::string& folder) {
  Reader reader(folder, "images");
  const size_t count = reader.ReadCount("images", kSmallestImage);
  std::vector<ColmapImage> images(count);
  std::set<std::string> names;
  for (ColmapImage& image : images) {
    image.id = reader.Read<uint32_t>("an image");
    image.camera_from_world.rotation = ReadRotation(reader, image.id);
    image.camera_from_world.translation = ReadVector(reader, "a camera position");
    image.camera_id = reader.Read<uint32_t>("an image");
    image.name = reader.ReadName();
    if (!names.insert(image.name).second)
      reader.Fail("the image name " + image.name + " occurs twice");
    image.keypoints.resize(reader.ReadCount("keypoints", 3 * 8));
    for (ColmapKeypoint& keypoint : image.keypoints) {
      keypoint.u = ReadCoordinate(reader, "a keypoint");
      keypoint.v = ReadCoordinate(reader, "a keypoint");
      keypoint.point_id = reader.Read<uint64_t>("a keypoint");
    }
  }
  reader.ExpectEnd();
  return images;
}

std::vector<ColmapPoint> ReadPoints(const std::string& folder) {
  Reader reader(folder, "points3D");
  const size_t count = reader.ReadCount("points", 8 + 3 * 8 + 3 + 8 + 8);
  std::vector<ColmapPoint> points(count);
  for (ColmapPoint& point : points) {
    point.id = reader.Read<uint64_t>("a point");
    point.position = ReadVector(reader, "a point's position");
    point.color = reader.Read<std::array<uint8_t, 3>>("a point");
    point.error = reader.Read<double>("a point");
    if (!std::isfinite(point.error)) point.error = -1;  // unknown
    point.track.resize(reader.ReadCount("track elements", 4 + 4));
    for (ColmapTrackElement& element : point.track) {
      element.image_id = reader.Read<uint32_t>("a track");
      element.keypoint = reader.Read<uint32_t>("a track");
    }
  }
  reader.ExpectEnd();
  return points;
}

template <typename Record>
const Record* FindById(const std::vector<Record>& records, uint64_t id) {
  const auto it =
      std::lower_bound(records.begin(), records.end(), id,
                       [](const Record& r, uint64_t value) { return r.id < value; });
  return it != records.end() && it->id == id ? &*it : nullptr;
}

[[noreturn]] void FailLink(const std::string& folder, const char* file,
                           const std::string& why) {
  throw InputError(why, folder + "/" + file, kDamagedHint);
}

template <typename Record>
void SortById(std::vector<Record>& records, const std::string& folder, const char* file) {
  std::ranges::stable_sort(records, {}, &Record::id);
  for (size_t i = 1; i < records.size(); ++i)
    if (records[i].id == records[i - 1].id)
      FailLink(folder, file, Concat("the id ", records[i].id, " occurs twice"));
}

void CheckLinks(const ColmapModel& model, const std::string& folder) {
  for (const ColmapImage& image : model.images) {
    if (model.FindCamera(image.camera_id) == nullptr)
      FailLink(folder, "images.bin",
               Concat("image ", image.id, " refers to camera ", image.camera_id,
                      ", which does not exist"));
    for (const ColmapKeypoint& keypoint : image.keypoints)
      if (keypoint.point_id != kNoColmapPoint && model.FindPoint(keypoint.point_id) == nullptr)
        FailLink(folder, "images.bin",
                 Concat("image ", image.id, " refers to point ", keypoint.point_id,
                        ", which does not exist"));
  }
  for (const ColmapPoint& point : model.points) {
    for (const ColmapTrackElement& element : point.track) {
      const ColmapImage* image = model.FindImage(element.image_id);
      if (image == nullptr || element.keypoint >= image->keypoints.size())
        FailLink(folder, "points3D.bin",
                 Concat("point ", point.id, " refers to keypoint ", element.keypoint,
                        " of image ", element.image_id, ", which does not exist"));
    }
  }
}

}  // namespace

const ColmapCamera* ColmapModel::FindCamera(uint32_t id) const { return FindById(cameras, id); }
const ColmapImage* ColmapModel::FindImage(uint32_t id) const { return FindById(images, id); }
const ColmapPoint* ColmapModel::FindPoint(uint64_t id) const { return FindById(points, id); }

Camera ColmapModel::CameraOf(const ColmapImage& image) const {
  const ColmapCamera* found = FindCamera(image.camera_id);
  REGRADE_CHECK(found != nullptr);
  Camera camera = found->intrinsics;
  camera.camera_from_world = image.camera_from_world;
  return camera;
}

uint64_t CountColmapImages(const std::string& folder) {
  std::ifstream binary(folder + "/images.bin", std::ios::binary | std::ios::ate);
  if (binary) {
    const auto bytes = static_cast<uint64_t>(std::max<std::streamoff>(0, binary.tellg()));
    uint64_t count = 0;
    binary.seekg(0);
    if (!binary.read(reinterpret_cast<char*>(&count), sizeof count)) return 0;
    const auto needed = CheckedMul(count, kSmallestImage);
    return needed && *needed <= bytes ? count : 0;
  }
  std::ifstream text(folder + "/images.txt", std::ios::binary);
  return CountTextImages({std::istreambuf_iterator<char>(text), {}});
}

ColmapModel ReadColmapModel(const std::string& folder) {
  ColmapModel model;
  model.cameras = ReadCameras(folder);
  model.images = ReadImages(folder);
  model.points = ReadPoints(folder);
  SortById(model.cameras, folder, "cameras.bin");
  SortById(model.images, folder, "images.bin");
  SortById(model.points, folder, "points3D.bin");
  CheckLinks(model, folder);
  return model;
}

}  // namespace regrade
