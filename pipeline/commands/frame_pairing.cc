#include "pipeline/commands/frame_pairing.h"

#include <algorithm>
#include <map>
#include <optional>

#include "kernels/base/error.h"
#include "pipeline/commands/frame_numbers.h"

namespace regrade {
namespace {

using Names = std::vector<std::string>;

Names NumberKeys(const Names& names) {
  Names keys;
  for (const FrameNumber& number : FrameNumbers(names))
    keys.push_back(std::to_string(number.number));
  return keys;
}

Names StemKeys(const Names& names) {
  Names keys;
  for (const std::string& name : names) keys.push_back(FrameStem(name));
  return keys;
}

// Nothing where a key is missing or not unique, or where too few agree to be no chance.
std::optional<std::vector<int>> PartnersByKey(const Names& reference, const Names& keys) {
  if (reference.empty() || keys.empty()) return std::nullopt;
  std::map<std::string, int> known;
  for (size_t i = 0; i < keys.size(); ++i)
    if (!known.emplace(keys[i], static_cast<int>(i)).second) return std::nullopt;
  if (Names unique = reference; true) {
    std::ranges::sort(unique);
    if (std::ranges::adjacent_find(unique) != unique.end()) return std::nullopt;
  }
  std::vector<int> partner;
  size_t found = 0;
  for (const std::string& key : reference) {
    const auto at = known.find(key);
    partner.push_back(at == known.end() ? -1 : at->second);
    found += at != known.end();
  }
  if (found < std::min({reference.size(), keys.size(), size_t{2}})) return std::nullopt;
  return partner;
}

std::string SizeText(const FrameFolder& folder) {
  return Concat(folder.width, " x ", folder.height, " px");
}

// "a.png, b.png, c.png and 4 more"
std::string Listed(const Names& names) {
  constexpr size_t kShown = 3;
  std::string text;
  for (size_t i = 0; i < std::min(kShown, names.size()); ++i)
    text += (i > 0 ? ", " : "") + names[i];
  if (names.size() > kShown) text += Concat(" and ", names.size() - kShown, " more");
  return text;
}

void CheckCounts(const FrameFolder& reference, const FrameFolder& sequence) {
  const size_t count = sequence.names.size(), of_reference = reference.names.size();
  if (count == of_reference) return;
  const std::string odd = count < of_reference
                              ? reference.names[count] + " of " + reference.folder
                              : sequence.names[of_reference] + " of " + sequence.folder;
  throw InputError(Concat(count, " frames, the reference has ", of_reference,
                          ", and their names do not say which belong together; in order, ", odd,
                          " has no counterpart"),
                   sequence.folder, "evaluate the same frames of each");
}

// The frames that stay must be evenly spaced in the reference.
void CheckEvenlySpaced(const std::vector<int>& kept, const FrameFolder& reference,
                       const std::vector<NamePairs>& pairs,
                       const std::vector<FrameFolder*>& sequences) {
  if (kept.size() < 3) return;
  int step = kept[1] - kept[0];
  for (size_t k = 1; k < kept.size(); ++k) step = std::min(step, kept[k] - kept[k - 1]);
  for (size_t k = 1; k < kept.size(); ++k) {
    if (kept[k] - kept[k - 1] == step) continue;
    const size_t missing = static_cast<size_t>(kept[k - 1] + step);
    size_t lacking = 0;
    while (lacking + 1 < pairs.size() && pairs[lacking].partner[missing] >= 0) ++lacking;
    throw InputError(reference.names[missing] + " of " + reference.folder +
                         " has no counterpart, but " +
                         reference.names[static_cast<size_t>(kept[k])] + " has one",
                     sequences[lacking]->folder,
                     "add it: pairs across it would be further apart than their gap");
  }
}

void Keep(const std::vector<int>& frames, FrameFolder* folder) {
  Names paths, names;
  std::vector<int> places;
  for (const int i : frames) {
    paths.push_back(folder->paths[static_cast<size_t>(i)]);
    names.push_back(folder->names[static_cast<size_t>(i)]);
    places.push_back(folder->places[static_cast<size_t>(i)]);
  }
  folder->paths = paths;
  folder->names = names;
  folder->places = places;
}

// What of the pairing a person has to know.
FramePairing Describe(const FrameFolder& reference, const FrameFolder& sequence,
                      const NamePairs& pairs) {
  FramePairing pairing{sequence.folder, pairs.by, {}, {}, ""};
  std::vector<bool> used(sequence.names.size(), false);
  int first = -1, last = -1, count = 0;
  for (size_t i = 0; i < pairs.partner.size(); ++i) {
    if (pairs.partner[i] < 0) {
      pairing.reference_left_out.push_back(reference.names[i]);
      continue;
    }
    used[static_cast<size_t>(pairs.partner[i])] = true;
    if (first < 0) first = static_cast<int>(i);
    last = static_cast<int>(i);
    ++count;
  }
  for (size_t i = 0; i < used.size(); ++i)
    if (!used[i]) pairing.left_out.push_back(sequence.names[i]);
  const auto both = [&](int i) {
    return sequence.names[static_cast<size_t>(pairs.partner[static_cast<size_t>(i)])] +
           " with " + reference.names[static_cast<size_t>(i)];
  };
  const std::string range = both(first) + (count > 1 ? " to " + both(last) : "");
  const std::string head =
      Concat(count, " frames of ", sequence.folder, " are paired with ", reference.folder);
  if (pairs.by == "order") {
    pairing.notice = head +
                     " in the order of their names, which have nothing in common: " + range +
                     "; rename them if these are other moments";
  } else if (!pairing.left_out.empty() || !pairing.reference_left_out.empty()) {
    pairing.notice = head + " by the " +
                     (pairs.by == "number" ? "numbers in their names" : "same names") + ": " +
                     range + ". Left out:";
    if (!pairing.left_out.empty()) pairing.notice += " " + Listed(pairing.left_out);
    if (!pairing.reference_left_out.empty())
      pairing.notice += std::string(pairing.left_out.empty() ? "" : ";") +
                        " of the reference " + Listed(pairing.reference_left_out);
    if (pairs.by == "number")
      pairing.notice += ". Renumber them if the same moments have other numbers";
  }
  return pairing;
}

}  // namespace

NamePairs PairNames(const Names& reference, const Names& names) {
  if (auto partner = PartnersByKey(NumberKeys(reference), NumberKeys(names)))
    return {*partner, "number"};
  if (auto partner = PartnersByKey(StemKeys(reference), StemKeys(names)))
    return {*partner, "name"};
  NamePairs pairs{{}, "order"};
  for (size_t i = 0; i < reference.size(); ++i)
    pairs.partner.push_back(i < names.size() ? static_cast<int>(i) : -1);
  return pairs;
}

std::vector<FramePairing> PairFolders(FrameFolder* reference,
                                      const std::vector<FrameFolder*>& sequences) {
  std::vector<FramePairing> pairings;
  std::vector<FrameFolder*> others;
  std::vector<NamePairs> pairs;
  for (FrameFolder* sequence : sequences) {
    if (sequence == reference) continue;
    if (reference->width != sequence->width || reference->height != sequence->height)
      throw InputError(
          "frames of " + SizeText(*sequence) + ", the reference has " + SizeText(*reference),
          sequence->folder, "render all sequences at one size");
    pairs.push_back(PairNames(reference->names, sequence->names));
    if (pairs.back().by == "order") CheckCounts(*reference, *sequence);
    pairings.push_back(Describe(*reference, *sequence, pairs.back()));
    others.push_back(sequence);
  }
  std::vector<int> kept;
  for (size_t i = 0; i < reference->names.size(); ++i)
    if (std::ranges::all_of(pairs, [i](const NamePairs& p) { return p.partner[i] >= 0; }))
      kept.push_back(static_cast<int>(i));
  if (kept.empty())
    throw InputError("no frame has a counterpart in every other folder", reference->folder,
                     "evaluate the same frames of each");
  CheckEvenlySpaced(kept, *reference, pairs, others);
  for (size_t s = 0; s < others.size(); ++s) {
    std::vector<int> of_sequence;
    for (const int i : kept) of_sequence.push_back(pairs[s].partner[static_cast<size_t>(i)]);
    Keep(of_sequence, others[s]);
  }
  Keep(kept, reference);
  return pairings;
}

}  // namespace regrade
