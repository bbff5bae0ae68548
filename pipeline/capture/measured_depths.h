// Depths that a device measured beside the photos: more points that photos saw.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "kernels/scene/image.h"
#include "reconstruct/scene/point_observations.h"

namespace regrade {

// Writes folder/00007.png for each photo that has a depth map in `maps`: its path, or an empty
// text; and the maps' unit, in world units of the poses, to folder/unit.json. A map is a PNG of
// one channel, of any size, with z in camera coordinates in that unit, and 0 where nothing was
// measured. One that cannot be read, has another aspect than its photo, more channels or 8
// bits is left out. Returns their number. `notes`: what was taken and left, for the user.
int StageDepths(const std::vector<std::string>& maps, const std::vector<StagedPhoto>& photos,
                double unit, const std::string& folder, std::vector<std::string>* notes);

// Adds the maps that StageDepths wrote to `folder`, by the photos' names there, and their unit.
void FindStagedDepths(const std::string& folder, std::map<std::string, std::string>* maps,
                      double* unit);

// Whether a pixel of a map of depths [H, W, 1] and its four neighbours are of one surface:
// within 5 % of its depth. False at the map's border, and where there is no depth.
bool IsOneSurface(const Image& z, int x, int y);

// PointsSeenBy with points of the staged depth maps, of which there may be none.
//
// The maps are held to the capture's points. Their unit is corrected by the median ratio, their
// relative error is the spread of the ratios (0.02 where there are no points), and a map which
// less than half of its photo's points agree with is left out. Where depths jump between
// neighbours there is no point. `notes`: what was found, for the user.
std::vector<std::vector<SeenPoint>> PointsOfViews(const Capture& capture,
                                                  const std::vector<int>& views,
                                                  const Similarity& field_from_world,
                                                  std::vector<std::string>* notes);

}  // namespace regrade
