#include "pipeline/images/video_writer.h"

#include <stdlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/mp4_faststart.h"
#include "pipeline/images/normalize_photo.h"

namespace regrade {
namespace {

constexpr uint64_t kMaxVideoBytes = uint64_t{4} << 30;

// OpenCV and FFmpeg talk on stderr about things that we find out and report ourselves. A level
// that the user has set stays.
void QuietLibraries() {
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);  // AV_LOG_QUIET
  if (::getenv("OPENCV_LOG_LEVEL") == nullptr)
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
}

uint8_t Byte(float value) {  // as in our PNG files
  return value > 0 ? static_cast<uint8_t>(std::min(value, 1.f) * 255.f + 0.5f) : 0;
}

}  // namespace

struct VideoWriter::State {
  std::string path, folder, temporary;
  int width, height;
  int frames = 0;
  cv::VideoWriter writer;
  cv::Mat padded;  // BGR bytes at the even size
};

// FFmpeg chooses the format by the name, which must end in .mp4: so the temporary is a folder.
VideoWriter::VideoWriter(const std::string& path, int width, int height,
                         double frames_per_second)
    : state_(std::make_unique<State>()) {
  REGRADE_CHECK_GT(width, 0);
  REGRADE_CHECK_GT(height, 0);
  REGRADE_CHECK_GT(frames_per_second, 0);
  QuietLibraries();
  State& s = *state_;
  s.path = path;
  s.folder = path + ".video" + kTemporarySuffix;
  s.temporary = s.folder + "/frames.mp4";
  s.width = width;
  s.height = height;
  s.padded.create(height + height % 2, width + width % 2, CV_8UC3);
  std::error_code error;
  std::filesystem::create_directory(s.folder, error);
  if (error)
    throw Error(ExitCode::kResources,
                "cannot create a folder for the video: " + error.message(), s.folder,
                "check the folder's permissions and the free space");
  try {
    s.writer.open(s.temporary, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'),
                  frames_per_second, s.padded.size(), true);
  } catch (const cv::Exception&) {
    // Reported below.
  }
  if (!s.writer.isOpened()) {
    std::filesystem::remove_all(s.folder, error);
    throw Error(ExitCode::kExternalProgram,
                "OpenCV cannot write H.264 video (avc1, " + std::to_string(s.padded.cols) +
                    " x " + std::to_string(s.padded.rows) + ")",
                path, "install OpenCV with FFmpeg and libx264, or go without the video");
  }
}

VideoWriter::~VideoWriter() {
  if (state_->folder.empty()) return;
  state_->writer.release();
  std::error_code ignored;
  std::filesystem::remove_all(state_->folder, ignored);
}

void VideoWriter::Add(const Image& frame) {
  State& s = *state_;
  REGRADE_CHECK_EQ(frame.width, s.width);
  REGRADE_CHECK_EQ(frame.height, s.height);
  const Image picture = CompositeOnWhite(frame);
  for (int y = 0; y < s.padded.rows; ++y)
    for (int x = 0; x < s.padded.cols; ++x) {
      const float* from = picture.at(std::min(x, s.width - 1), std::min(y, s.height - 1));
      const bool grey = picture.channels == 1;
      s.padded.at<cv::Vec3b>(y, x) = {Byte(from[grey ? 0 : 2]), Byte(from[grey ? 0 : 1]),
                                      Byte(from[0])};
    }
  try {
    s.writer.write(s.padded);
  } catch (const cv::Exception& e) {
    throw Error(ExitCode::kExternalProgram, "cannot encode a frame: " + e.err, s.path);
  }
  ++s.frames;
}

void VideoWriter::Finish() {
  State& s = *state_;
  s.writer.release();
  std::string movie;
  try {
    movie = MoveIndexFirst(ReadWholeFile(s.temporary, kMaxVideoBytes));
  } catch (const Error& e) {
    throw Error(ExitCode::kResources,
                "the video encoder left no whole file: " + e.what_failed(), s.path,
                "free some space, then run the same command again");
  }
  // The encoder does not report a full disk; only what can be read back counts.
  WriteFileAtomically(s.temporary, movie);
  const int readable = CountVideoFrames(s.temporary);
  if (readable != s.frames)
    throw Error(ExitCode::kResources,
                "the video has " + std::to_string(readable) + " frames that can be read, of " +
                    std::to_string(s.frames),
                s.path, "free some space, then run the same command again");
  RenameDurably(s.temporary, s.path);
  std::error_code ignored;
  std::filesystem::remove_all(s.folder, ignored);
  s.folder.clear();
}

int CountVideoFrames(const std::string& path) {
  QuietLibraries();
  try {
    cv::VideoCapture capture(path, cv::CAP_FFMPEG);
    if (!capture.isOpened()) return -1;
    int frames = 0;
    while (capture.grab()) ++frames;
    return frames;
  } catch (const cv::Exception&) {
    return -1;
  }
}

}  // namespace regrade
