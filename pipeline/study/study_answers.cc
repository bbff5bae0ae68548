#include "pipeline/study/study_answers.h"

#include <algorithm>
#include <optional>
#include <set>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr char kFormat[] = "regrade study answers";
constexpr size_t kMostAnswers = 100'000;

struct Participant {
  std::string name;
  std::vector<Choice> choices;
  bool passed = true, finished = false;
};

Choice ReadChoice(const JsonValue& json, size_t methods) {
  Choice choice;
  const auto method = [&](const JsonValue& value) {
    const int64_t index = value.AsInt();
    if (index < 0 || index >= static_cast<int64_t>(methods))
      throw InputError(Concat("there is no method ", index));
    return static_cast<int>(index);
  };
  for (const JsonValue& shown : json.At("shown").AsArray())
    choice.shown.push_back(method(shown));
  choice.chosen = method(json.At("chosen"));
  if (std::ranges::find(choice.shown, choice.chosen) == choice.shown.end())
    throw InputError("the chosen film was not shown");
  const std::set<int> different(choice.shown.begin(), choice.shown.end());
  if (different.size() != choice.shown.size() || different.size() < 2)
    throw InputError("a choice needs two different methods");
  return choice;
}

Participant ReadParticipant(const JsonValue& json, size_t methods) {
  Participant participant;
  participant.name = json.At("participant").AsString();
  const JsonValue::Array& answers = json.At("answers").AsArray();
  if (answers.size() > kMostAnswers) throw InputError("more than 100000 answers");
  for (const JsonValue& answer : answers) {
    const JsonValue* check = answer.Find("check");
    if (check != nullptr && check->AsBool())
      participant.passed &= answer.At("passed").AsBool();
    else
      participant.choices.push_back(ReadChoice(answer, methods));
  }
  participant.finished = static_cast<int64_t>(answers.size()) == json.At("trials").AsInt();
  return participant;
}

std::string Percent(const JsonValue& value) {
  return value.IsNumber() ? Format("%.0f %%", 100 * value.AsDouble()) : std::string("-");
}

std::string Range(const JsonValue& row, const std::string& name) {
  const JsonValue& low = row.At(name + "_low");
  return low.IsNumber() ? Percent(low) + " to " + Percent(row.At(name + "_high")) : "-";
}

}  // namespace

StudyAnswers ReadStudyAnswers(const std::vector<std::string>& paths) {
  StudyAnswers answers;
  std::set<std::string> seen;
  for (const std::string& path : paths) {
    const JsonValue json = ReadJsonFile(path);
    const auto refuse = [&](const std::string& what, const std::string& hint) {
      throw InputError(what, path, hint);
    };
    try {
      const JsonValue* format = json.Find("format");
      if (format == nullptr || !format->IsString() || format->AsString() != kFormat ||
          json.At("version").AsInt() != 1)
        refuse("this is not a file of answers to a study", "take those that its page saved");
      const std::string study = json.At("study").AsString();
      std::vector<std::string> methods;
      for (const JsonValue& method : json.At("methods").AsArray())
        methods.push_back(method.AsString());
      if (answers.study.empty()) {
        answers.study = study;
        answers.question = json.At("question").AsString();
        answers.methods = methods;
      }
      if (study != answers.study || methods != answers.methods)
        refuse("these are answers to another study than " + paths[0] + "'s",
               "analyse each study on its own");
      Participant participant = ReadParticipant(json, methods.size());
      if (!seen.insert(participant.name).second)
        refuse("participant " + participant.name + " is in two files", "keep one of them");
      if (!participant.passed) {
        ++answers.failed;
        continue;
      }
      answers.unfinished += !participant.finished;
      answers.participants.push_back(std::move(participant.choices));
    } catch (const Error& error) {
      if (!error.where().empty()) throw;
      throw InputError(error.what_failed(), path);
    }
  }
  size_t choices = 0;
  for (const auto& participant : answers.participants) choices += participant.size();
  if (choices == 0)
    throw InputError(
        answers.failed > 0 ? "nobody passed the attention checks" : "there is no answer",
        paths[0]);
  return answers;
}

JsonValue AnalyseStudy(const StudyAnswers& answers) {
  const int methods = static_cast<int>(answers.methods.size());
  std::vector<Choice> all;
  for (const auto& participant : answers.participants)
    all.insert(all.end(), participant.begin(), participant.end());
  const std::vector<double> strength = BradleyTerry(all, methods);
  const std::vector<Interval> intervals = BradleyTerryIntervals(answers.participants, methods);

  JsonValue::Array rows, pairs;
  for (int m = 0; m < methods; ++m) {
    int64_t chosen = 0, shown = 0;
    for (const Choice& choice : all) {
      chosen += choice.chosen == m;
      shown += std::ranges::count(choice.shown, m);
    }
    JsonValue row = JsonValue::Object{{"name", answers.methods[m]},
                                      {"chosen", chosen},
                                      {"shown", shown},
                                      {"share", JsonValue()},
                                      {"share_low", JsonValue()},
                                      {"share_high", JsonValue()},
                                      {"strength", strength[m]},
                                      {"strength_low", JsonValue()},
                                      {"strength_high", JsonValue()}};
    if (shown > 0) {
      const Interval share = BinomialInterval(chosen, shown);
      row["share"] = static_cast<double>(chosen) / static_cast<double>(shown);
      row["share_low"] = share.low;
      row["share_high"] = share.high;
    }
    if (!intervals.empty()) {
      row["strength_low"] = intervals[m].low;
      row["strength_high"] = intervals[m].high;
    }
    rows.push_back(std::move(row));
  }
  for (int a = 0; a < methods; ++a)
    for (int b = a + 1; b < methods; ++b) {
      int64_t first = 0, both = 0;  // choices of one of the two where both were shown
      for (const Choice& choice : all) {
        const bool shown =
            std::ranges::count(choice.shown, a) && std::ranges::count(choice.shown, b);
        first += shown && choice.chosen == a;
        both += shown && (choice.chosen == a || choice.chosen == b);
      }
      if (both == 0) continue;
      const Interval share = BinomialInterval(first, both);
      pairs.push_back(JsonValue::Object{{"first", answers.methods[a]},
                                        {"second", answers.methods[b]},
                                        {"first_chosen", first},
                                        {"choices", both},
                                        {"share_low", share.low},
                                        {"share_high", share.high},
                                        {"sign_test", SignTest(first, both)}});
    }
  return JsonValue::Object{{"study", answers.study},
                           {"question", answers.question},
                           {"participants", static_cast<int64_t>(answers.participants.size())},
                           {"failed_checks", answers.failed},
                           {"unfinished", answers.unfinished},
                           {"choices", static_cast<int64_t>(all.size())},
                           {"methods", std::move(rows)},
                           {"pairs", std::move(pairs)}};
}

std::string FormatStudy(const JsonValue& analysis) {
  std::string text = Concat(
      analysis.At("question").AsString(), "\n", analysis.At("participants").AsInt(),
      " participants, ", analysis.At("choices").AsInt(), " choices; left out after a failed ",
      "check: ", analysis.At("failed_checks").AsInt(),
      "; unfinished: ", analysis.At("unfinished").AsInt(), "\n\n");
  for (const JsonValue& row : analysis.At("methods").AsArray())
    text += Concat(row.At("name").AsString(), ": chosen ", row.At("chosen").AsInt(), " of ",
                   row.At("shown").AsInt(), ", ", Percent(row.At("share")), " (",
                   Range(row, "share"), "); Bradley-Terry ", Percent(row.At("strength")), " (",
                   Range(row, "strength"), ")\n");
  text += "\n";
  for (const JsonValue& pair : analysis.At("pairs").AsArray())
    text += Concat(pair.At("first").AsString(), " over ", pair.At("second").AsString(), ": ",
                   pair.At("first_chosen").AsInt(), " of ", pair.At("choices").AsInt(), " (",
                   Range(pair, "share"),
                   "), p = ", Format("%.2g", pair.At("sign_test").AsDouble()), "\n");
  return text +
         "\n95 % intervals. Shares and p are exact binomial ones, as if all choices were "
         "independent; Bradley-Terry's are a bootstrap over participants.\n";
}

}  // namespace regrade
