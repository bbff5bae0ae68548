#include "pipeline/files/json_file.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"

namespace regrade {
namespace {

constexpr size_t kMaxDepth = 64;

struct Position {
  int line = 1, column = 0;  // of the byte read last
};

// Reads the text byte by byte and counts lines.
struct CountingIterator {
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  const char* at = nullptr;
  Position* position = nullptr;

  reference operator*() const { return *at; }
  CountingIterator& operator++() {
    if (*at == '\n') {
      ++position->line;
      position->column = 0;
    } else {
      ++position->column;
    }
    ++at;
    return *this;
  }
  bool operator==(const CountingIterator& o) const { return at == o.at; }
  bool operator!=(const CountingIterator& o) const { return at != o.at; }
};

// The same text for the life of the program, so that values can refer to it. There are as many
// as files are read.
const std::string* Kept(const std::string& where) {
  static std::mutex mutex;
  static std::set<std::string> all;
  const std::lock_guard lock(mutex);
  return &*all.insert(where).first;
}

class Builder : public nlohmann::json_sax<nlohmann::json> {
 public:
  Builder(const Position* position, const std::string& where, ExitCode code)
      : position_(position), where_(Kept(where)), code_(code) {}

  JsonValue Take() { return std::move(root_); }

  bool null() override { return Put(JsonValue()); }
  bool boolean(bool value) override { return Put(value); }
  bool number_integer(number_integer_t value) override {
    return Put(static_cast<int64_t>(value));
  }
  bool number_unsigned(number_unsigned_t value) override {
    if (value <= static_cast<uint64_t>(INT64_MAX)) return Put(static_cast<int64_t>(value));
    return Put(static_cast<uint64_t>(value));
  }
  bool number_float(number_float_t value, const string_t&) override { return Put(value); }
  bool string(string_t& value) override { return Put(std::move(value)); }
  bool binary(binary_t&) override { return false; }
  bool start_object(size_t) override { return Open(JsonValue::Object()); }
  bool start_array(size_t) override { return Open(JsonValue::Array()); }
  bool end_object() override { return Close(); }
  bool end_array() override { return Close(); }
  bool key(string_t& name) override {
    if (!levels_.back().keys.insert(name).second)
      Refuse("the key \"" + name + "\" appears twice");
    key_ = std::move(name);
    return true;
  }
  bool parse_error(size_t, const std::string&,
                   const nlohmann::detail::exception& error) override {
    // The library's text ends with the reason, after ": ".
    const std::string text = error.what();
    const size_t cut = text.find("parse error at ");
    const size_t colon = cut == std::string::npos ? cut : text.find(": ", cut);
    Refuse(colon == std::string::npos ? text : text.substr(colon + 2));
  }

 private:
  struct Level {
    JsonValue value;
    std::string key;  // in its parent
    std::set<std::string> keys;
  };

  [[noreturn]] void Refuse(const std::string& why) const {
    throw Error(code_, why,
                Concat(*where_, ":", position_->line, ":", std::max(1, position_->column)));
  }
  void SetPosition(JsonValue* value) const {
    value->SetPosition(where_, position_->line, std::max(1, position_->column));
  }
  bool Put(JsonValue value) {
    if (value.line() == 0) SetPosition(&value);
    if (levels_.empty())
      root_ = std::move(value);
    else if (levels_.back().value.IsArray())
      levels_.back().value.Append(std::move(value));
    else  // key() has checked that the key is new
      const_cast<JsonValue::Object&>(levels_.back().value.AsObject())
          .emplace_back(std::move(key_), std::move(value));
    return true;
  }
  bool Open(JsonValue value) {
    if (levels_.size() >= kMaxDepth) Refuse("more than 64 levels");
    SetPosition(&value);
    levels_.push_back({std::move(value), std::move(key_), {}});
    return true;
  }
  bool Close() {
    Level level = std::move(levels_.back());
    levels_.pop_back();
    key_ = std::move(level.key);
    return Put(std::move(level.value));
  }

  const Position* position_;
  const std::string* where_;
  ExitCode code_;
  JsonValue root_;
  std::vector<Level> levels_;
  std::string key_;
};

nlohmann::ordered_json ToLibrary(const JsonValue& value) {
  struct Visitor {
    nlohmann::ordered_json operator()(std::monostate) const { return nullptr; }
    nlohmann::ordered_json operator()(bool v) const { return v; }
    nlohmann::ordered_json operator()(int64_t v) const { return v; }
    nlohmann::ordered_json operator()(uint64_t v) const { return v; }
    nlohmann::ordered_json operator()(double v) const { return v; }
    nlohmann::ordered_json operator()(const std::string& v) const { return v; }
    nlohmann::ordered_json operator()(const JsonValue::Array& v) const {
      auto array = nlohmann::ordered_json::array();
      for (const JsonValue& element : v) array.push_back(ToLibrary(element));
      return array;
    }
    nlohmann::ordered_json operator()(const JsonValue::Object& v) const {
      auto object = nlohmann::ordered_json::object();
      for (const auto& [key, member] : v) object[key] = ToLibrary(member);
      return object;
    }
  };
  return std::visit(Visitor{}, value.variant());
}

}  // namespace

bool JsonValue::IsNumber() const {
  return std::holds_alternative<int64_t>(value_) || std::holds_alternative<uint64_t>(value_) ||
         std::holds_alternative<double>(value_);
}

std::string JsonValue::Place() const {
  return text_ == nullptr ? "" : Concat(*text_, ", line ", line_);
}

void JsonValue::RefuseKind(const char* expected) const {
  throw InputError(std::string(expected) + " expected", Place());
}

bool JsonValue::AsBool() const {
  if (const bool* value = std::get_if<bool>(&value_)) return *value;
  RefuseKind("true or false");
}

int64_t JsonValue::AsInt() const {
  if (const int64_t* value = std::get_if<int64_t>(&value_)) return *value;
  if (const double* value = std::get_if<double>(&value_))
    if (std::floor(*value) == *value && std::abs(*value) < 0x1p62)
      return static_cast<int64_t>(*value);
  RefuseKind("a whole number");
}

double JsonValue::AsDouble() const {
  if (const double* value = std::get_if<double>(&value_)) return *value;
  if (const int64_t* value = std::get_if<int64_t>(&value_)) return static_cast<double>(*value);
  if (const uint64_t* value = std::get_if<uint64_t>(&value_))
    return static_cast<double>(*value);
  RefuseKind("a number");
}

const std::string& JsonValue::AsString() const {
  if (const std::string* value = std::get_if<std::string>(&value_)) return *value;
  RefuseKind("a text");
}

const JsonValue::Array& JsonValue::AsArray() const {
  if (const Array* value = std::get_if<Array>(&value_)) return *value;
  RefuseKind("a list");
}

const JsonValue::Object& JsonValue::AsObject() const {
  if (const Object* value = std::get_if<Object>(&value_)) return *value;
  RefuseKind("an object");
}

const JsonValue* JsonValue::Find(std::string_view key) const {
  if (const Object* object = std::get_if<Object>(&value_))
    for (const Member& member : *object)
      if (member.first == key) return &member.second;
  return nullptr;
}

const JsonValue& JsonValue::At(std::string_view key) const {
  if (const JsonValue* value = Find(key)) return *value;
  throw InputError("\"" + std::string(key) + "\" is missing", Place());
}

JsonValue& JsonValue::operator[](std::string_view key) {
  if (IsNull()) value_ = Object();
  Object& object = std::get<Object>(value_);
  for (Member& member : object)
    if (member.first == key) return member.second;
  return object.emplace_back(key, JsonValue()).second;
}

void JsonValue::Append(JsonValue element) {
  if (IsNull()) value_ = Array();
  std::get<Array>(value_).push_back(std::move(element));
}

bool JsonValue::operator==(const JsonValue& other) const {
  if (IsNumber() && other.IsNumber()) {
    if (value_.index() == other.value_.index()) return value_ == other.value_;
    return AsDouble() == other.AsDouble();
  }
  return value_ == other.value_;
}

JsonValue ParseJson(std::string_view text, const std::string& where, ExitCode code) {
  if (text.substr(0, 3) == "\xef\xbb\xbf") text.remove_prefix(3);
  Position position;
  Builder builder(&position, where, code);
  nlohmann::json::sax_parse(CountingIterator{text.data(), &position},
                            CountingIterator{text.data() + text.size(), &position}, &builder);
  return builder.Take();
}

std::string PlaceIn(const std::string& path, const JsonValue& at) {
  return Concat(path, ":", at.line(), ":", at.column());
}

JsonValue ReadJsonFile(const std::string& path, uint64_t max_bytes, ExitCode code) {
  return ParseJson(ReadWholeFile(path, max_bytes), path, code);
}

std::string DumpJson(const JsonValue& value, int indent) {
  return ToLibrary(value).dump(indent, ' ', false,
                               nlohmann::ordered_json::error_handler_t::replace);
}

void WriteJsonFile(const std::string& path, const JsonValue& value) {
  WriteFileAtomically(path, DumpJson(value) + "\n");
}

}  // namespace regrade
