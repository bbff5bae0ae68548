#include "reconstruct/colmap/listed_pairs.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <set>

namespace regrade {
namespace {

constexpr size_t kPairsAtATime = 200;
// Distances in the order of a film's frames, and of photos (as COLMAP's sequential matcher).
constexpr size_t kFrameGaps[] = {1, 2, 3, 4, 6, 8, 12, 16};
constexpr size_t kPhotoGaps[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
constexpr size_t kAnchorEvery = 8;  // frames

}  // namespace

bool HasClips(const std::vector<StagedPhoto>& photos) {
  return std::ranges::any_of(photos, [](const StagedPhoto& photo) { return photo.clip >= 0; });
}

PhotoPairs PairsOfClips(const std::vector<StagedPhoto>& photos) {
  std::map<int, std::vector<size_t>> sequences;  // by film; -1: photos
  for (size_t i = 0; i < photos.size(); ++i) sequences[photos[i].clip].push_back(i);
  std::set<std::pair<size_t, size_t>> pairs;
  std::vector<size_t> anchors;
  for (const auto& [clip, members] : sequences) {
    const auto add = [&pairs, &members = members](size_t gap) {
      for (size_t i = 0; i + gap < members.size(); ++i)
        pairs.emplace(members[i], members[i + gap]);
    };
    if (clip < 0)
      for (const size_t gap : kPhotoGaps) add(gap);
    else
      for (const size_t gap : kFrameGaps) add(gap);
    const size_t every =
        clip >= 0 ? kAnchorEvery : (members.size() + kAnchorPhotos - 1) / kAnchorPhotos;
    for (size_t i = 0; i < members.size(); i += every) anchors.push_back(members[i]);
  }
  for (size_t i = 0; i < anchors.size(); ++i)
    for (size_t j = i + 1; j < anchors.size(); ++j)
      pairs.insert(std::minmax(anchors[i], anchors[j]));
  return {pairs.begin(), pairs.end()};
}

void MatchListed(const PhotoPairs& pairs, const std::vector<StagedPhoto>& photos,
                 const std::string& database, const std::string& list, int threads,
                 const std::function<void(const ColmapArguments&, double fraction)>& run) {
  for (size_t begin = 0; begin < pairs.size(); begin += kPairsAtATime) {
    const size_t end = std::min(begin + kPairsAtATime, pairs.size());
    std::ofstream file(list, std::ios::trunc);
    for (size_t i = begin; i < end; ++i)
      file << photos[pairs[i].first].name << " " << photos[pairs[i].second].name << "\n";
    file.close();
    run({{"database_path", database},
         {"match_list_path", list},
         {"SiftMatching.use_gpu", "0"},
         {"SiftMatching.num_threads", std::to_string(threads > 0 ? threads : -1)}},
        static_cast<double>(end - begin) / static_cast<double>(pairs.size()));
  }
}

}  // namespace regrade
