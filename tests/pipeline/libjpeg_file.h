// JPEG files that our encoder does not write: CMYK, and thousands of scans.
#pragma once

#include <stdlib.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>
//
#include <jpeglib.h>

namespace regrade::testing {

// A JPEG written with libjpeg.
inline std::string LibjpegFile(const std::vector<unsigned char>& samples, int width, int height,
                               J_COLOR_SPACE space, int channels, int extra_scans) {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &buffer, &size);
  info.image_width = width;
  info.image_height = height;
  info.input_components = channels;
  info.in_color_space = space;
  jpeg_set_defaults(&info);
  // One scan for the mean, then one scan for each coefficient, twice.
  std::vector<jpeg_scan_info> scans;
  if (extra_scans > 0) {
    scans.push_back({1, {0}, 0, 0, 0, 0});
    for (int k = 1; k < 64; ++k) scans.push_back({1, {0}, k, k, 0, 1});
    for (int k = 1; k < 64; ++k) scans.push_back({1, {0}, k, k, 1, 0});
    scans.resize(std::min<size_t>(scans.size(), extra_scans));
    info.scan_info = scans.data();
    info.num_scans = static_cast<int>(scans.size());
  }
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row =
        const_cast<unsigned char*>(&samples[size_t{info.next_scanline} * width * channels]);
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  std::string bytes(reinterpret_cast<char*>(buffer), size);
  jpeg_destroy_compress(&info);
  free(buffer);
  return bytes;
}

}  // namespace regrade::testing
