#include "pipeline/images/jpeg_decoder.h"

// jpeglib.h needs FILE and size_t to be declared before it.
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
//
#include <jerror.h>
#include <jpeglib.h>

#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr unsigned int kMarkerBytes = 65533;  // the longest body a marker can have

// State of libjpeg's callbacks. `base` comes first: libjpeg passes pointers to it.
struct ErrorState {
  jpeg_error_mgr base;
  jmp_buf jump;
  char message[JMSG_LENGTH_MAX];
  char first_warning[JMSG_LENGTH_MAX];
  int64_t damage_warnings;
  bool too_many_scans;
};

ErrorState& StateOf(j_common_ptr info) { return *reinterpret_cast<ErrorState*>(info->err); }

[[noreturn]] void OnError(j_common_ptr info) {
  ErrorState& state = StateOf(info);
  info->err->format_message(info, state.message);
  longjmp(state.jump, 1);
}

// Odd headers that affect no pixel; common in files from cameras and phones.
bool IsRemark(int code) {
  return code == JWRN_NOT_SEQUENTIAL || code == JWRN_ADOBE_XFORM || code == JWRN_JFIF_MAJOR;
}

void OnMessage(j_common_ptr info, int level) {
  if (level >= 0 || IsRemark(info->err->msg_code)) return;
  ErrorState& state = StateOf(info);
  if (state.damage_warnings++ == 0) info->err->format_message(info, state.first_warning);
}

void OnProgress(j_common_ptr info) {
  if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number <= kMaxJpegScans) return;
  ErrorState& state = StateOf(info);
  state.too_many_scans = true;
  longjmp(state.jump, 1);
}

class Decompressor {
 public:
  Decompressor() {
    std::memset(&info_, 0, sizeof info_);
    std::memset(&state_, 0, sizeof state_);
    std::memset(&progress_, 0, sizeof progress_);
    info_.err = jpeg_std_error(&state_.base);
    state_.base.error_exit = OnError;
    state_.base.emit_message = OnMessage;
    progress_.progress_monitor = OnProgress;
  }
  ~Decompressor() { jpeg_destroy_decompress(&info_); }
  Decompressor(const Decompressor&) = delete;
  Decompressor& operator=(const Decompressor&) = delete;

  // On an error libjpeg leaves the methods below by longjmp: they hold no object with a
  // destructor. They return false then, and state() has the reason.
  bool ReadHeader(std::string_view bytes) {
    if (setjmp(state_.jump)) return false;
    jpeg_create_decompress(&info_);
    info_.progress = &progress_;
    jpeg_mem_src(&info_, reinterpret_cast<const unsigned char*>(bytes.data()),
                 static_cast<unsigned long>(bytes.size()));
    jpeg_save_markers(&info_, JPEG_APP0 + 1, kMarkerBytes);
    jpeg_save_markers(&info_, JPEG_APP0 + 2, kMarkerBytes);
    jpeg_read_header(&info_, TRUE);
    const bool four = info_.num_components == 4;
    const bool grey = info_.num_components == 1;
    info_.out_color_space = four ? JCS_CMYK : grey ? JCS_GRAYSCALE : JCS_RGB;
    return true;
  }

  // The caller frees `profile`.
  bool ReadIccProfile(JOCTET** profile, unsigned int* size) {
    if (setjmp(state_.jump)) return false;
    return jpeg_read_icc_profile(&info_, profile, size);
  }

  // `row` holds one row of bytes.
  bool ReadPixels(unsigned char* row, Image* image) {
    if (setjmp(state_.jump)) return false;
    jpeg_start_decompress(&info_);
    while (info_.output_scanline < info_.output_height) {
      const int y = static_cast<int>(info_.output_scanline);
      jpeg_read_scanlines(&info_, &row, 1);
      ConvertRow(row, image->at(0, y));
    }
    jpeg_finish_decompress(&info_);
    return true;
  }

  const jpeg_decompress_struct& info() const { return info_; }
  const ErrorState& state() const { return state_; }

 private:
  // Bytes become floats; inks (stored inverted, as Adobe does) become RGB.
  void ConvertRow(const unsigned char* row, float* pixels) const {
    const int64_t width = info_.output_width;
    if (info_.out_color_space != JCS_CMYK) {
      for (int64_t i = 0; i < width * info_.output_components; ++i)
        pixels[i] = static_cast<float>(row[i]) / 255.f;
      return;
    }
    const bool inverted = info_.saw_Adobe_marker;
    for (int64_t x = 0; x < width; ++x) {
      int light[4];
      for (int c = 0; c < 4; ++c) light[c] = inverted ? row[4 * x + c] : 255 - row[4 * x + c];
      for (int c = 0; c < 3; ++c)
        pixels[3 * x + c] = static_cast<float>(light[c] * light[3]) / 65025.f;
    }
  }

  jpeg_decompress_struct info_;
  ErrorState state_;
  jpeg_progress_mgr progress_;
};

[[noreturn]] void Refuse(const Decompressor& jpeg, const std::string& where) {
  if (jpeg.state().too_many_scans)
    throw InputError(Concat("a JPEG of more than ", kMaxJpegScans,
                            " scans, which only serves to keep a decoder busy"),
                     where);
  throw InputError(std::string("damaged JPEG: ") + jpeg.state().message, where);
}

}  // namespace

JpegPicture DecodeJpeg(std::string_view bytes, const std::string& where,
                       const PictureSizeCheck& check) {
  Decompressor jpeg;
  if (!jpeg.ReadHeader(bytes)) Refuse(jpeg, where);
  const int width = static_cast<int>(jpeg.info().image_width);
  const int height = static_cast<int>(jpeg.info().image_height);
  check(width, height, jpeg.info().num_components);

  JpegPicture picture;
  picture.from_cmyk = jpeg.info().out_color_space == JCS_CMYK;
  for (jpeg_saved_marker_ptr marker = jpeg.info().marker_list;
       marker != nullptr && picture.exif.empty(); marker = marker->next) {
    const std::string_view body(reinterpret_cast<const char*>(marker->data),
                                marker->data_length);
    if (marker->marker == JPEG_APP0 + 1 && body.substr(0, 4) == "Exif") picture.exif = body;
  }
  JOCTET* profile = nullptr;
  unsigned int profile_bytes = 0;
  if (jpeg.ReadIccProfile(&profile, &profile_bytes))
    picture.icc.assign(reinterpret_cast<const char*>(profile), profile_bytes);
  std::free(profile);

  const bool grey = jpeg.info().out_color_space == JCS_GRAYSCALE;
  picture.image = Image(width, height, grey ? 1 : 3);
  std::vector<unsigned char> row(static_cast<size_t>(width) * jpeg.info().num_components);
  if (!jpeg.ReadPixels(row.data(), &picture.image)) Refuse(jpeg, where);
  picture.damage_warnings = jpeg.state().damage_warnings;
  picture.first_warning = jpeg.state().first_warning;
  return picture;
}

}  // namespace regrade
