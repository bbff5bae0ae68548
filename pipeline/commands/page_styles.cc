#include "pipeline/commands/page_styles.h"

#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {

namespace fs = std::filesystem;

std::vector<std::string> WantedStyles(const std::string& folder, const Arguments& words,
                                      std::vector<std::string>* left) {
  if (!fs::exists(folder + "/field.npz"))
    throw InputError("holds no reconstruction", folder,
                     "make one with `regrade run` or `regrade reconstruct`");
  std::vector<std::string> styles;
  if (words.size() == 1) styles = LearnedStyles(folder, left);
  for (size_t i = 1; i < words.size(); ++i)
    styles.push_back(ChosenLearnedStyle(folder, words[i]));
  CheckResults(folder, styles);
  return styles;
}

}  // namespace regrade
