#include "pipeline/heat_map_files.h"

#include <filesystem>
#include <map>
#include <utility>

#include "evaluate/heat_map.h"
#include "pipeline/files/image_file.h"

namespace regrade {
namespace {

constexpr char kFolder[] = "heatmaps";

void RemoveOldMaps(const std::string& folder) {
  std::error_code none;
  std::vector<std::filesystem::path> old;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(".png") && name.find("_gap") != std::string::npos)
      old.push_back(entry.path());
  }
  for (const auto& path : old) std::filesystem::remove(path, none);
}

}  // namespace

std::vector<HeatMapFile> WriteHeatMaps(const Workspace& workspace, const FrameSource& reference,
                                       const std::vector<NamedFrameSource>& sequences,
                                       const ConsistencyOptions& options,
                                       const ConsistencyReport& report) {
  RemoveOldMaps(workspace.Path(kFolder));
  const PairMotionFunction motion = EstimatedMotion(reference, options.mode, options.flow);
  std::map<std::pair<int, int>, PairMotion> motions;  // sequences often share their worst pair
  std::vector<HeatMapFile> written;
  for (const NamedFrameSource& sequence : sequences)
    for (const int gap : options.gaps) {
      const PairResult* worst = WorstPair(sequence.name, gap, report.pairs);
      if (worst == nullptr || *worst->error == 0) continue;
      const auto key = std::pair(worst->from, worst->to);
      if (!motions.count(key)) motions[key] = motion(worst->from, worst->to);
      const std::string path = std::string(kFolder) + "/" + HeatMapFileName(*worst);
      WritePng8(workspace.NewPath(path),
                ErrorHeatMap(sequence.frames.frame(worst->from),
                             sequence.frames.frame(worst->to), motions[key]));
      written.push_back({sequence.name, gap, worst->from, worst->to, path});
    }
  return written;
}

}  // namespace regrade
