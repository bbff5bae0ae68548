// Cameras in the layout of NSVF (Liu et al. 2020), in which Plenoxels' authors have Tanks and
// Temples: intrinsics.txt, pose/NAME.txt for each picture rgb/NAME.png, bbox.txt.
//
// Poses are camera-to-world with OpenCV's axes (x right, y down, z forward).
#pragma once

#include <set>
#include <string>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/capture.h"

namespace regrade {

// The numbers of each line that has some, separated by white space or commas. Throws
// Error(kInput) with the line: no file, more than 64 KiB, a word that is no number, a number
// that is not finite, or no number at all.
std::vector<std::vector<double>> ReadNumberFile(const std::string& path);

// Focal lengths and principal point, in pixels of the pictures; size and pose are left out.
// intrinsics.txt is a matrix of 3 x 3, 3 x 4 or 4 x 4 numbers, or begins with a line that
// begins with focal length and principal point.
//
// Throws Error(kInput) for numbers that are neither, skewed pixels, or values that are no
// lens's.
Camera ReadNsvfIntrinsics(const std::string& path);

// Throws Error(kInput) for anything but 3 x 4 or 4 x 4 numbers of a rigid motion.
RigidTransform ReadNsvfPose(const std::string& path);

// bbox.txt: the lowest and the highest corner, then the width of a voxel, which is not used.
// Throws Error(kInput) for a box without a volume.
WorldBox ReadNsvfBox(const std::string& path);

// What the names of pictures say: 0_ is for training, 2_ for tests, 1_ for validation, which
// stands for tests where there are none. Other names have no prefix and belong to neither.
struct NsvfSplit {
  std::set<std::string> only;  // pictures that are used; empty: all, nothing is split
  std::set<std::string> test;  // of them, those that are measured and not fitted
};
NsvfSplit SplitNsvf(const std::vector<std::string>& names);

}  // namespace regrade
