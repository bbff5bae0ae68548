#include "pipeline/stages/heat_map_files.h"

#include <filesystem>

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
                                       const std::vector<NamedFrameSource>& sequences,
                                       const ConsistencyReport& report) {
  std::vector<HeatMapFile> written;
  for (const auto& [pair, motion, at, warped] : report.worst)
    for (const auto& [name, frames] : sequences) {
      if (name != pair.sequence) continue;
      const std::string path = std::string(kHeatMapFolder) + "/" + HeatMapFileName(pair);
      WritePng8(workspace.NewPath(path),
                ErrorHeatMap(frames.frame(at), frames.frame(warped), *motion));
      written.push_back({name, pair.to - pair.from, pair.from, pair.to, path});
    }
  return written;
}

}  // namespace regrade
