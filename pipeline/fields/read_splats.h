// Reads files of splats that other programs wrote.
#pragma once

#include <cstdint>
#include <filesystem>

#include "pipeline/fields/splat_scene.h"

namespace regrade {

// Whether a file is for ReadSplats: one that begins as such a format does, or whose name ends
// as those of splats do, so that ReadSplats says what is wrong with it.
bool IsSplatFile(const std::filesystem::path& path);

// Tells by its content which format the file has, whatever its name: a PLY of Gaussians
// (gaussian_ply.h), PlayCanvas' compressed PLY (compressed_ply.h), Niantic's SPZ (spz.h) or
// .splat (dot_splat.h).
//
// Splats that cannot be drawn are left out and counted. Memory is taken for at most what the
// file's size allows, 100 times of it where it is packed. Throws Error(kInput) that names the
// file and a remedy: for another format, a file that is damaged, lacks what a splat needs or
// has none, and where the file and its splats together take more than `budget` bytes;
// Error(kResources) as ReadWholeFile.
SplatScene ReadSplats(const std::filesystem::path& path, uint64_t budget = uint64_t{64} << 30);

}  // namespace regrade
