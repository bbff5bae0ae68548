// The styles of an output folder: each has a folder styles/NAME, itself a workspace, with the
// records and results of the stages from "style_2d" to "report".
#pragma once

#include <string>
#include <vector>

namespace regrade {

inline constexpr char kStylesFolder[] = "styles";

// The name of a style's folder and its picture, or the several that are matched.
struct NamedStyle {
  std::string name;
  std::vector<std::string> pictures;
};

// The content of a style's pictures, in their order: of one picture the hash of its file.
std::string PicturesHash(const std::vector<std::string>& pictures);

// The name of a picture's file without its ending: letters, digits, '-', '_' and '.'; other
// characters become '_', and a leading dot is removed. "style" where nothing is left.
std::string SafeStyleName(const std::string& picture);

// The path of a style's folder in an output folder. Throws Error(kInput) where it is a link.
std::string StyleFolder(const std::string& folder, const std::string& name);

// A name for each picture: that of its file, or `name`, for a single picture, where it is not
// empty. A picture keeps the name that it has in `folder`, which need not exist: pictures are
// told apart by their content. Where another picture has a name, "-2" and so on is added.
// `together`: all are the pictures of one style, named after all of them.
//
// Throws Error(kUsage) for a `name` that is not safe, is that of another picture, or is given
// with several pictures; for a picture that is given twice; Error(kInput) for one that cannot
// be read.
std::vector<NamedStyle> NameStyles(const std::string& folder,
                                   const std::vector<std::string>& pictures,
                                   const std::string& name, bool together = false);

// Names of the styles that were begun in `folder`, in natural order; links are none.
std::vector<std::string> StyleNames(const std::string& folder);

// A style that was learned, so that it can be shown: it has a network, and its stage "stylize"
// was not begun again since. One that was begun and ended before, also from `regrade view`, is
// none.
bool IsLearned(const std::string& folder, const std::string& name);

// Those of StyleNames that were learned; the others are added to `left`, if that is not null.
std::vector<std::string> LearnedStyles(const std::string& folder,
                                       std::vector<std::string>* left = nullptr);

// "left out: sunset is not finished", "left out: dusk, sunset are not finished", and what to
// do; empty where nothing is left out.
std::string LeftOutText(const std::string& folder, const std::vector<std::string>& left);

// ChosenStyle of a command that shows it. Throws Error(kInput), also for a style that was not
// learned.
std::string ChosenLearnedStyle(const std::string& folder, const std::string& name);

// The style that a command continues: `name`, or the last one that was finished, or the only
// one that was learned or, where none was, begun. Throws Error(kInput), which lists the names,
// where there is none.
std::string ChosenStyle(const std::string& folder, const std::string& name);

// For what only reads: Workspace::CheckResults of the scene and of these styles.
void CheckResults(const std::string& folder, const std::vector<std::string>& styles);

// Notes that this style was finished last, and copies its film, where it has one, to styled.mp4
// of `folder`. Throws Error(kResources).
void PublishStyle(const std::string& folder, const std::string& name);

// In run.json of a style's folder: the hash of its pictures.
inline constexpr char kPictureHash[] = "picture_hash";

}  // namespace regrade
