#include "pipeline/stages/heat_map_files.h"

#include <filesystem>
#include <map>
#include <utility>

#include "evaluate/heat_map.h"
#include "pipeline/images/image_file.h"

namespace regrade {

void BeginHeatMaps(const Workspace& workspace) {
  workspace.NewPath(std::string(kHeatMapFolder) + "/x");
  const std::string folder = workspace.Path(kHeatMapFolder);
  std::error_code none;
  std::vector<std::filesystem::path> old;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(".png") && name.find("_gap") != std::string::npos)
      old.push_back(entry.path());
  }
  for (const auto& path : old) std::filesystem::remove(path, none);
}

std::vector<HeatMapFile> WriteHeatMaps(const Workspace& workspace,
                                       const PairMotionFunction& motion,
                                       const std::vector<NamedFrameSource>& sequences,
                                       const std::vector<int>& gaps,
                                       const ConsistencyReport& report) {
  std::map<std::pair<int, int>, PairMotion> motions;  // sequences often share their worst pair
  std::vector<HeatMapFile> written;
  for (const NamedFrameSource& sequence : sequences)
    for (const int gap : gaps) {
      const PairResult* worst = WorstPair(sequence.name, gap, report.pairs);
      if (worst == nullptr || *worst->error == 0) continue;
      const auto key = std::pair(worst->from, worst->to);
      if (!motions.count(key)) motions[key] = motion(worst->from, worst->to);
      const std::string path = std::string(kHeatMapFolder) + "/" + HeatMapFileName(*worst);
      WritePng8(workspace.NewPath(path),
                ErrorHeatMap(sequence.frames.frame(worst->from),
                             sequence.frames.frame(worst->to), motions[key]));
      written.push_back({sequence.name, gap, worst->from, worst->to, path});
    }
  return written;
}

}  // namespace regrade
