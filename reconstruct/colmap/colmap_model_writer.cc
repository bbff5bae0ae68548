// Writes the three files of a COLMAP model.
#include <Eigen/Geometry>
#include <array>
#include <fstream>

#include "kernels/base/error.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

std::array<double, 4> QuaternionOf(const Mat3d& rotation) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> matrix(&rotation(0, 0));
  Eigen::Quaterniond q = Eigen::Quaterniond(matrix).normalized();
  if (q.w() < 0) q.coeffs() *= -1;
  return {q.w(), q.x(), q.y(), q.z()};
}

namespace {

class Writer {
 public:
  Writer(const std::string& folder, const std::string& name)
      : path_(folder + "/" + name), file_(path_, std::ios::binary | std::ios::trunc) {}

  template <typename T>
  void Write(const T& value) {
    file_.write(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  void WriteName(const std::string& name) { file_.write(name.c_str(), name.size() + 1); }

  void Close() {
    file_.close();
    if (file_.fail()) throw ResourceError("cannot write it", path_, "is the disk full?");
  }

 private:
  std::string path_;
  std::ofstream file_;
};

void WriteCameras(const ColmapModel& model, const std::string& folder) {
  Writer writer(folder, "cameras.bin");
  writer.Write<uint64_t>(model.cameras.size());
  for (const ColmapCamera& camera : model.cameras) {
    const ColmapLensInfo& info = InfoOf(camera.lens);
    REGRADE_CHECK_GT(info.focals, 0);
    const Camera& c = camera.intrinsics;
    writer.Write(camera.id);
    writer.Write(camera.lens);
    writer.Write<uint64_t>(c.width);
    writer.Write<uint64_t>(c.height);
    writer.Write(c.fx);
    if (info.focals == 2) writer.Write(c.fy);
    writer.Write(c.cx);
    writer.Write(c.cy);
    for (int i = 0; i < info.coefficients; ++i) writer.Write(c.distortion[i]);
  }
  writer.Close();
}

void WriteImages(const ColmapModel& model, const std::string& folder) {
  Writer writer(folder, "images.bin");
  writer.Write<uint64_t>(model.images.size());
  for (const ColmapImage& image : model.images) {
    writer.Write(image.id);
    writer.Write(QuaternionOf(image.camera_from_world.rotation));
    writer.Write(image.camera_from_world.translation);
    writer.Write(image.camera_id);
    writer.WriteName(image.name);
    writer.Write<uint64_t>(image.keypoints.size());
    for (const ColmapKeypoint& keypoint : image.keypoints) writer.Write(keypoint);
  }
  writer.Close();
}

void WritePoints(const ColmapModel& model, const std::string& folder) {
  Writer writer(folder, "points3D.bin");
  writer.Write<uint64_t>(model.points.size());
  for (const ColmapPoint& point : model.points) {
    writer.Write(point.id);
    writer.Write(point.position);
    writer.Write(point.color);
    writer.Write(point.error);
    writer.Write<uint64_t>(point.track.size());
    for (const ColmapTrackElement& element : point.track) writer.Write(element);
  }
  writer.Close();
}

static_assert(sizeof(ColmapKeypoint) == 24 && sizeof(ColmapTrackElement) == 8 &&
              sizeof(Vec3d) == 24);

}  // namespace

void WriteColmapModel(const ColmapModel& model, const std::string& folder) {
  WriteCameras(model, folder);
  WriteImages(model, folder);
  WritePoints(model, folder);
}

}  // namespace regrade
