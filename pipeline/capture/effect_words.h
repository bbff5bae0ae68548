// The words of --effects.
#pragma once

#include <map>
#include <string>

namespace regrade {

// Parses --effects: "auto", or overrides such as "ndc=off,alpha=on". Throws Error(kUsage)
// naming the word for anything else.
std::map<std::string, bool> ParseEffects(const std::string& text);

// Decided by the fit's trial (choose_degree.h).
inline constexpr char kViewDependence[] = "view-dependence";
// Decided by stage "pose" (pose_profile.h).
inline constexpr char kPoseRefinement[] = "pose-refinement";

}  // namespace regrade
