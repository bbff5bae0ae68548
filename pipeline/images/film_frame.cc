#include "pipeline/images/film_frame.h"

#include <algorithm>
#include <cstddef>
#include <new>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
}

namespace regrade {
namespace {

// The nine numbers of the display matrix, or null.
const int32_t* DisplayMatrixOf(const AVStream& stream) {
#if LIBAVFORMAT_VERSION_INT >= AV_VERSION_INT(60, 15, 100)
  const AVPacketSideData* side =
      av_packet_side_data_get(stream.codecpar->coded_side_data,
                              stream.codecpar->nb_coded_side_data, AV_PKT_DATA_DISPLAYMATRIX);
  const bool whole = side != nullptr && side->size >= 9 * sizeof(int32_t);
  return whole ? reinterpret_cast<const int32_t*>(side->data) : nullptr;
#else
  size_t size = 0;
  const uint8_t* data = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, &size);
  const bool whole = data != nullptr && size >= 9 * sizeof(int32_t);
  return whole ? reinterpret_cast<const int32_t*>(data) : nullptr;
#endif
}

bool IsInterlaced(const AVFrame& frame) {
#if LIBAVUTIL_VERSION_INT >= AV_VERSION_INT(58, 7, 100)
  return (frame.flags & AV_FRAME_FLAG_INTERLACED) != 0;
#else
  return frame.interlaced_frame != 0;
#endif
}

bool TopFieldIsFirst(const AVFrame& frame) {
#if LIBAVUTIL_VERSION_INT >= AV_VERSION_INT(58, 7, 100)
  return (frame.flags & AV_FRAME_FLAG_TOP_FIELD_FIRST) != 0;
#else
  return frame.top_field_first != 0;
#endif
}

// Pixels that are not whole bytes or native words.
constexpr uint64_t kOddForms = AV_PIX_FMT_FLAG_BITSTREAM | AV_PIX_FMT_FLAG_HWACCEL |
                               AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_BE;

// The rows between those of parity `kept` become the mean of their neighbours.
template <typename Value>
void InterpolateRows(uint8_t* plane, ptrdiff_t stride, int values, int height, int kept) {
  const auto row = [&](int y) { return reinterpret_cast<Value*>(plane + y * stride); };
  for (int y = 1 - kept; y < height; y += 2) {
    const Value* above = row(y > 0 ? y - 1 : std::min(1, height - 1));
    const Value* below = row(y + 1 < height ? y + 1 : std::max(y - 1, 0));
    for (int x = 0; x < values; ++x)
      row(y)[x] = static_cast<Value>((above[x] + below[x] + 1) / 2);
  }
}

}  // namespace

// The matrix takes a stored point (x, y) to the shown one (a x + c y, b x + d y), y downwards,
// but for a shift. Of EXIF's eight orientations the nearest: the one whose matrix has the
// largest inner product with it.
int OrientationOf(const AVStream& stream) {
  const int32_t* m = DisplayMatrixOf(stream);
  if (m == nullptr) return 1;
  constexpr int kMatrices[8][4] = {{1, 0, 0, 1}, {-1, 0, 0, 1}, {-1, 0, 0, -1}, {1, 0, 0, -1},
                                   {0, 1, 1, 0}, {0, 1, -1, 0}, {0, -1, -1, 0}, {0, -1, 1, 0}};
  int best = 1;
  double most = 0;
  for (int i = 0; i < 8; ++i) {
    const int* k = kMatrices[i];
    const double product =
        1.0 * k[0] * m[0] + 1.0 * k[1] * m[1] + 1.0 * k[2] * m[3] + 1.0 * k[3] * m[4];
    if (product <= most) continue;
    most = product;
    best = i + 1;
  }
  return best;
}

bool KeepOneField(AVFrame* frame) {
  if (!IsInterlaced(*frame)) return false;
  const auto format = static_cast<AVPixelFormat>(frame->format);
  const AVPixFmtDescriptor* form = av_pix_fmt_desc_get(format);
  if (form == nullptr || (form->flags & kOddForms) != 0) return false;
  if (av_frame_make_writable(frame) < 0) throw std::bad_alloc();
  const int kept = TopFieldIsFirst(*frame) ? 0 : 1;
  for (int plane = 0; plane < av_pix_fmt_count_planes(format); ++plane) {
    const bool chroma = plane == 1 || plane == 2;
    const int height =
        chroma ? AV_CEIL_RSHIFT(frame->height, form->log2_chroma_h) : frame->height;
    const int bytes = av_image_get_linesize(format, frame->width, plane);
    if (form->comp[0].depth > 8)
      InterpolateRows<uint16_t>(frame->data[plane], frame->linesize[plane], bytes / 2, height,
                                kept);
    else
      InterpolateRows<uint8_t>(frame->data[plane], frame->linesize[plane], bytes, height, kept);
  }
  return true;
}

}  // namespace regrade
