// As much of JSON Schema as docs/schema uses: type, enum, properties, required,
// additionalProperties: false, items, minimum, maximum.
#pragma once

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/places.h"

namespace interneuron::watch {

inline nlohmann::json schema_of(const std::string& name) {
  std::ifstream file(places::source() + "/docs/schema/" + name);
  return nlohmann::json::parse(file);
}

inline bool is_of_type(const nlohmann::json& value, const std::string& type) {
  if (type == "integer") return value.is_number_integer();
  if (type == "number") return value.is_number();
  return value.type_name() == type;
}

// What in `value` is not as the schema says, each with its place; empty: nothing.
inline std::vector<std::string> violations(const nlohmann::json& schema,
                                           const nlohmann::json& value,
                                           const std::string& place = "$") {
  std::vector<std::string> out;
  const auto join = [&out](std::vector<std::string> more) {
    out.insert(out.end(), more.begin(), more.end());
  };
  if (schema.contains("enum") && std::ranges::find(schema["enum"], value) == schema["enum"].end()) {
    out.push_back(place + ": " + value.dump() + " is none of " + schema["enum"].dump());
  }
  if (schema.contains("type")) {
    const auto types = schema["type"].is_array()
                           ? schema["type"].get<std::vector<std::string>>()
                           : std::vector<std::string>{schema["type"].get<std::string>()};
    if (std::ranges::none_of(types, [&](const auto& t) { return is_of_type(value, t); })) {
      out.push_back(place + ": " + value.dump() + " is not of type " + schema["type"].dump());
      return out;
    }
  }
  if (value.is_number() &&
      (value < schema.value("minimum", value) || value > schema.value("maximum", value))) {
    out.push_back(place + ": " + value.dump() + " is out of range");
  }
  if (value.is_object() && schema.contains("properties")) {
    for (const auto& key : schema.value("required", nlohmann::json::array())) {
      if (!value.contains(key)) out.push_back(place + ": no key " + key.dump());
    }
    for (const auto& [key, item] : value.items()) {
      if (schema["properties"].contains(key)) {
        join(violations(schema["properties"][key], item, place + "." + key));
      } else if (!schema.value("additionalProperties", true)) {
        out.push_back(place + ": unknown key " + key);
      }
    }
  }
  if (value.is_array() && schema.contains("items")) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      join(violations(schema["items"], value[i], place + "[" + std::to_string(i) + "]"));
    }
  }
  return out;
}

}  // namespace interneuron::watch
