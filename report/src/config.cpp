#include "tubetrack/report/config.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "tubetrack/report/nearest_name.hpp"
#include "tubetrack/sensors/json_problem.hpp"

namespace tubetrack {

namespace {

using Json = nlohmann::ordered_json;

/// Calls visit(key, field) for every setting. The structured bindings make a new field a compile error here, so that no
/// setting can be forgotten in the file.
template <class Model, class Visit>
void visit_noise(Model& model, Visit&& visit) {
  auto& [name, axial_constant_m, axial_quadratic_per_m, axial_reference_m, axial_grazing, lateral_px, disparity_step_px,
         baseline_focal_m_px, depth_step_m, radius_relative] = model;
  visit("name", name);
  visit("axial_constant_m", axial_constant_m);
  visit("axial_quadratic_per_m", axial_quadratic_per_m);
  visit("axial_reference_m", axial_reference_m);
  visit("axial_grazing", axial_grazing);
  visit("lateral_px", lateral_px);
  visit("disparity_step_px", disparity_step_px);
  visit("baseline_focal_m_px", baseline_focal_m_px);
  visit("depth_step_m", depth_step_m);
  visit("radius_relative", radius_relative);
}

template <class Config, class Visit>
void visit_config(Config& config, Visit&& visit) {
  auto& [radius_min_m, radius_max_m, radius_m, varying_radius, depth_min_m, depth_max_m, roi_u_px, roi_v_px,
         roi_width_px, roi_height_px, min_length_radii, min_length_m, min_width_px, min_bend_radii, cell_m, threads,
         deadline_ms, noise] = config;
  visit("radius_min_m", radius_min_m);
  visit("radius_max_m", radius_max_m);
  visit("radius_m", radius_m);
  visit("varying_radius", varying_radius);
  visit("depth_min_m", depth_min_m);
  visit("depth_max_m", depth_max_m);
  visit("roi_u_px", roi_u_px);
  visit("roi_v_px", roi_v_px);
  visit("roi_width_px", roi_width_px);
  visit("roi_height_px", roi_height_px);
  visit("min_length_radii", min_length_radii);
  visit("min_length_m", min_length_m);
  visit("min_width_px", min_width_px);
  visit("min_bend_radii", min_bend_radii);
  visit("cell_m", cell_m);
  visit("threads", threads);
  visit("deadline_ms", deadline_ms);
  visit("noise", noise);
}

/// What is wrong with the file, without its name: caught in parse_config and read_noise_model only.
struct Refusal {
  std::string message;
};

void refuse_unknown_keys(const Json& json, const std::vector<std::string>& known, const std::string& prefix) {
  for (const auto& item : json.items()) {
    const std::string& key = item.key();
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    const auto nearest = nearest_name(key, known);
    throw Refusal{fmt::format("{}{}: unknown key{}; known are {}", prefix, key,
                              nearest ? fmt::format(", did you mean {}?", *nearest) : "", fmt::join(known, ", "))};
  }
}

void read_value(const Json& json, const std::string& key, double& value) {
  if (!json.is_number()) throw Refusal{fmt::format("{}: got {}, takes a number", key, json.dump())};
  value = json.get<double>();
}

void read_value(const Json& json, const std::string& key, int& value) {
  if (!json.is_number_integer() || json < -1000000 || json > 1000000) {
    throw Refusal{fmt::format("{}: got {}, takes a whole number", key, json.dump())};
  }
  value = json.get<int>();
}

void read_value(const Json& json, const std::string& key, bool& value) {
  if (!json.is_boolean()) throw Refusal{fmt::format("{}: got {}, takes true or false", key, json.dump())};
  value = json.get<bool>();
}

void read_value(const Json& json, const std::string& key, std::string& value) {
  if (!json.is_string()) throw Refusal{fmt::format("{}: got {}, takes a text", key, json.dump())};
  value = json.get<std::string>();
}

void read_value(const Json& json, const std::string& key, std::optional<double>& value) {
  if (json.is_null()) return value.reset();
  read_value(json, key, value.emplace());
}

/// `prefix` goes before the fields' names in messages.
void read_noise_fields(const Json& json, const std::string& prefix, NoiseModel& value) {
  std::vector<std::string> known;
  visit_noise(value, [&](const char* field, auto& target) {
    known.emplace_back(field);
    if (json.contains(field)) read_value(json.at(field), prefix + field, target);
  });
  refuse_unknown_keys(json, known, prefix);
  if (auto valid = validate(value); !valid) throw Refusal{prefix + valid.error().message};
}

void read_value(const Json& json, const std::string& key, NoiseModel& value) {
  if (json.is_string()) {
    auto model = noise_model_by_name(json.get<std::string>());
    if (!model) throw Refusal{fmt::format("{}: {}", key, model.error().message)};
    value = std::move(*model);
    return;
  }
  if (!json.is_object()) throw Refusal{fmt::format("{}: got {}, takes a name or an object", key, json.dump())};
  read_noise_fields(json, key + ".", value);
}

TrackerConfig config_from(const Json& json, TrackerConfig config) {
  if (!json.is_object()) throw Refusal{"the file takes one JSON object, like {\"radius_m\": 0.02}"};
  std::vector<std::string> known;
  visit_config(config, [&](const char* field, auto& target) {
    known.emplace_back(field);
    if (json.contains(field)) read_value(json.at(field), field, target);
  });
  refuse_unknown_keys(json, known, "");
  if (auto valid = validate(config); !valid) throw Refusal{valid.error().message};
  return config;
}

Expected<std::string> read_text(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  if (file) text << file.rdbuf();
  if (!file || text.fail()) {
    return tl::make_unexpected(Error::usage(fmt::format("{}: cannot be read; give a JSON file", path.string())));
  }
  return text.str();
}

/// Runs `read(json)`, whatever it throws comes back as a usage error that names the file.
template <class Read>
auto guarded(const std::string& text, const std::string& name, Read&& read) -> Expected<decltype(read(Json()))> {
  try {
    return read(Json::parse(text, nullptr, true, true));
  } catch (const Refusal& refusal) {
    return tl::make_unexpected(Error::usage(fmt::format("{}: {}", name, refusal.message)));
  } catch (const Json::exception& problem) {
    return tl::make_unexpected(Error::usage(fmt::format("{}: is no JSON: {}", name, json_problem(problem))));
  }
}

}  // namespace

Expected<TrackerConfig> parse_config(const std::string& text, const std::string& name, const TrackerConfig& defaults) {
  return guarded(text, name, [&](const Json& json) { return config_from(json, defaults); });
}

Expected<TrackerConfig> read_config(const std::filesystem::path& path, const TrackerConfig& defaults) {
  return read_text(path).and_then([&](const std::string& text) { return parse_config(text, path.string(), defaults); });
}

Expected<NoiseModel> read_noise_model(const std::filesystem::path& path) {
  return read_text(path).and_then([&](const std::string& text) {
    return guarded(text, path.string(), [&](const Json& json) {
      if (!json.is_object()) throw Refusal{"the file takes one JSON object, like {\"axial_constant_m\": 0.002}"};
      NoiseModel model;
      model.name = path.stem().string();
      read_noise_fields(json, "", model);
      return model;
    });
  });
}

std::string noise_model_text(const NoiseModel& model) {
  Json json;
  visit_noise(model, [&json](const char* field, const auto& value) { json[field] = value; });
  return json.dump(2) + "\n";
}

Expected<void> write_noise_model(const NoiseModel& model, const std::filesystem::path& path) {
  std::ofstream file(path);
  file << noise_model_text(model) << std::flush;
  if (file) return {};
  return tl::make_unexpected(Error::failed(fmt::format("{}: {}", path.string(), std::strerror(errno))));
}

std::string config_text(const TrackerConfig& config) {
  Json json;
  visit_config(config, [&json](const char* field, const auto& value) {
    using Field = std::decay_t<decltype(value)>;
    if constexpr (std::is_same_v<Field, NoiseModel>) {
      visit_noise(value, [&json](const char* part, const auto& number) { json["noise"][part] = number; });
    } else if constexpr (std::is_same_v<Field, std::optional<double>>) {
      json[field] = value ? Json(*value) : Json(nullptr);
    } else {
      json[field] = value;
    }
  });
  return json.dump(2) + "\n";
}

}  // namespace tubetrack
