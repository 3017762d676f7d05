#include "tubetrack/report/result_json.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "rounded.hpp"
#include "tubetrack/sensors/json_problem.hpp"

namespace tubetrack {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::pair<TrackStatus, std::string_view> kStatusNames[] = {{TrackStatus::ok, "ok"},
                                                                     {TrackStatus::empty, "empty"},
                                                                     {TrackStatus::corrupt, "corrupt"},
                                                                     {TrackStatus::no_pose, "no_pose"},
                                                                     {TrackStatus::deadline, "deadline"}};
constexpr std::pair<TubeState, std::string_view> kStateNames[] = {
    {TubeState::tracked, "tracked"}, {TubeState::occluded, "occluded"}, {TubeState::lost, "lost"}};
constexpr std::pair<Segment::Type, std::string_view> kSegmentNames[] = {
    {Segment::Type::straight, "straight"}, {Segment::Type::arc, "arc"}, {Segment::Type::free, "free"}};

template <class Enum, std::size_t n>
std::string_view name_of(const std::pair<Enum, std::string_view> (&names)[n], Enum value) {
  for (const auto& [known, name] : names) {
    if (known == value) return name;
  }
  return "?";
}

template <class Enum, std::size_t n>
Enum value_of(const std::pair<Enum, std::string_view> (&names)[n], const std::string& text, const char* key) {
  for (const auto& [value, name] : names) {
    if (name == text) return value;
  }
  throw std::runtime_error(fmt::format("\"{}\": \"{}\" is not known", key, text));
}

double three_digits(double value) {
  if (value == 0.0 || !std::isfinite(value)) return value;
  const double per_unit = std::pow(10.0, 2.0 - std::floor(std::log10(std::abs(value))));
  return rounded(value, per_unit);
}

Json segment_json(const Segment& segment) {
  Json json{
      {"type", name_of(kSegmentNames, segment.type)}, {"from_m", micro(segment.from_m)}, {"to_m", micro(segment.to_m)}};
  if (segment.type == Segment::Type::arc) {
    json["bend_radius_m"] = micro(segment.bend_radius_m);
    json["bend_angle_rad"] = micro(segment.bend_angle_rad);
  } else {
    json["length_m"] = micro(segment.to_m - segment.from_m);
  }
  return json;
}

Json point_json(const Eigen::Vector3d& p) {
  return {micro(p.x()), micro(p.y()), micro(p.z())};
}

/// The closing row has no bend.
Json bend_row_json(const BendRow& row) {
  Json json{{"length_m", micro(row.length_m)},
            {"rotation_rad", micro(row.rotation_rad)},
            {"angle_rad", micro(row.angle_rad)}};
  const bool bend = row.angle_rad > 0.0;
  if (bend) json["bend_radius_m"] = micro(row.bend_radius_m);
  json["length_sigma_m"] = three_digits(row.length_sigma_m);
  if (bend) {
    json["rotation_sigma_rad"] = three_digits(row.rotation_sigma_rad);
    json["angle_sigma_rad"] = three_digits(row.angle_sigma_rad);
    json["bend_radius_sigma_m"] = three_digits(row.bend_radius_sigma_m);
  }
  json["ill_conditioned"] = row.ill_conditioned;
  return json;
}

Json bend_table_json(const BendTable& table) {
  Json json{{"xyz_m", Json::array()}, {"lra", Json::array()}};
  for (const Eigen::Vector3d& p : table.xyz_m) json["xyz_m"].push_back(point_json(p));
  for (const BendRow& row : table.lra) json["lra"].push_back(bend_row_json(row));
  return json;
}

Json tube_json(const Tube& tube) {
  Json json{{"id", tube.id},
            {"state", name_of(kStateNames, tube.state)},
            {"radius_m", micro(tube.radius_m)},
            {"radius_sigma_m", three_digits(tube.radius_sigma_m)},
            {"length_m", micro(tube.length_m)},
            {"confidence", rounded(tube.confidence, 1e3)},
            {"centerline_m", Json::array()},
            {"sigma_m", Json::array()},
            {"node_covariance_m2", Json::array()},
            {"node_visible", tube.node_visible}};
  for (const Eigen::Vector3d& p : tube.centerline_m) json["centerline_m"].push_back(point_json(p));
  for (const double sigma : tube.sigma_m) json["sigma_m"].push_back(three_digits(sigma));
  for (const Eigen::Matrix3d& c : tube.node_covariance_m2) {
    json["node_covariance_m2"].push_back({three_digits(c(0, 0)), three_digits(c(0, 1)), three_digits(c(0, 2)),
                                          three_digits(c(1, 1)), three_digits(c(1, 2)), three_digits(c(2, 2))});
  }
  for (const double radius : tube.node_radius_m) json["node_radius_m"].push_back(micro(radius));
  for (const double sigma : tube.node_radius_sigma_m) json["node_radius_sigma_m"].push_back(three_digits(sigma));
  if (tube.closed) json["closed"] = true;
  json["segments"] = Json::array();
  for (const Segment& segment : tube.segments) json["segments"].push_back(segment_json(segment));
  if (!tube.bend_table.lra.empty()) json["bend_table"] = bend_table_json(tube.bend_table);
  return json;
}

Segment segment_from(const Json& json) {
  Segment segment;
  segment.type = value_of(kSegmentNames, json.at("type").get<std::string>(), "type");
  segment.from_m = json.at("from_m").get<double>();
  segment.to_m = json.at("to_m").get<double>();
  segment.bend_radius_m = json.value("bend_radius_m", 0.0);
  segment.bend_angle_rad = json.value("bend_angle_rad", 0.0);
  return segment;
}

Eigen::Vector3d point_from(const Json& json) {
  return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

BendTable bend_table_from(const Json& json) {
  BendTable table;
  for (const Json& p : json.at("xyz_m")) table.xyz_m.push_back(point_from(p));
  for (const Json& j : json.at("lra")) {
    BendRow row;
    row.length_m = j.at("length_m").get<double>();
    row.rotation_rad = j.at("rotation_rad").get<double>();
    row.angle_rad = j.at("angle_rad").get<double>();
    row.bend_radius_m = j.value("bend_radius_m", 0.0);
    row.length_sigma_m = j.value("length_sigma_m", 0.0);
    row.rotation_sigma_rad = j.value("rotation_sigma_rad", 0.0);
    row.angle_sigma_rad = j.value("angle_sigma_rad", 0.0);
    row.bend_radius_sigma_m = j.value("bend_radius_sigma_m", 0.0);
    row.ill_conditioned = j.value("ill_conditioned", false);
    table.lra.push_back(row);
  }
  return table;
}

Tube tube_from(const Json& json) {
  Tube tube;
  tube.id = json.at("id").get<std::int64_t>();
  tube.state = value_of(kStateNames, json.at("state").get<std::string>(), "state");
  tube.radius_m = json.at("radius_m").get<double>();
  tube.radius_sigma_m = json.at("radius_sigma_m").get<double>();
  tube.length_m = json.at("length_m").get<double>();
  tube.confidence = json.at("confidence").get<double>();
  for (const Json& p : json.at("centerline_m")) tube.centerline_m.push_back(point_from(p));
  tube.sigma_m = json.at("sigma_m").get<std::vector<double>>();
  tube.node_visible = json.at("node_visible").get<std::vector<bool>>();
  tube.closed = json.value("closed", false);
  tube.node_radius_m = json.value("node_radius_m", std::vector<double>());
  tube.node_radius_sigma_m = json.value("node_radius_sigma_m", std::vector<double>());
  for (const Json& c : json.at("node_covariance_m2")) {
    const auto v = c.get<std::array<double, 6>>();
    tube.node_covariance_m2.emplace_back(
        (Eigen::Matrix3d() << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5]).finished());
  }
  for (const Json& segment : json.at("segments")) tube.segments.push_back(segment_from(segment));
  if (json.contains("bend_table")) tube.bend_table = bend_table_from(json.at("bend_table"));
  return tube;
}

StageTimes stages_from(const Json& json) {
  return {json.at("update").get<double>(), json.at("normals").get<double>(), json.at("accumulate").get<double>(),
          json.at("trace").get<double>(),  json.at("fit").get<double>(),     json.at("segment").get<double>()};
}

TubeFrame frame_from(const Json& json) {
  TubeFrame frame;
  frame.frame = json.at("frame").get<std::int64_t>();
  frame.timestamp_s = json.at("timestamp_s").get<double>();
  frame.frame_id = json.at("frame_id").get<std::string>();
  frame.status = value_of(kStatusNames, json.at("status").get<std::string>(), "status");
  frame.problem = json.value("error", std::string());
  frame.dropped = json.at("dropped").get<std::int64_t>();
  frame.latency_ms = json.value("latency_ms", 0.0);
  if (json.contains("stages_ms")) frame.stages = stages_from(json.at("stages_ms"));
  for (const Json& tube : json.at("tubes")) frame.tubes.push_back(tube_from(tube));
  return frame;
}

}  // namespace

std::string_view status_name(TrackStatus status) {
  return name_of(kStatusNames, status);
}

std::string result_line(const TubeFrame& frame, bool with_timing) {
  Json json{{"frame", frame.frame},
            {"timestamp_s", micro(frame.timestamp_s)},
            {"frame_id", frame.frame_id},
            {"status", status_name(frame.status)}};
  if (!frame.problem.empty()) json["error"] = frame.problem;
  json["dropped"] = frame.dropped;
  if (with_timing) {
    const StageTimes& t = frame.stages;
    json["latency_ms"] = rounded(frame.latency_ms, 1e3);
    json["stages_ms"] = {{"update", rounded(t.update_ms, 1e3)},
                         {"normals", rounded(t.normals_ms, 1e3)},
                         {"accumulate", rounded(t.accumulate_ms, 1e3)},
                         {"trace", rounded(t.trace_ms, 1e3)},
                         {"fit", rounded(t.fit_ms, 1e3)},
                         {"segment", rounded(t.segment_ms, 1e3)}};
  }
  json["tubes"] = Json::array();
  for (const Tube& tube : frame.tubes) json["tubes"].push_back(tube_json(tube));
  // A file name in `error` may not be UTF-8; dump would throw.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Expected<TubeFrame> parse_result_line(std::string_view line) {
  try {
    return frame_from(Json::parse(line));
  } catch (const std::exception& problem) {
    return tl::make_unexpected(Error::failed(fmt::format("not a result of tubetrack: {}", json_problem(problem))));
  }
}

Expected<std::vector<TubeFrame>> read_result_lines(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) {
    return tl::make_unexpected(Error::failed(
        fmt::format("{}: cannot be opened; give a file that `tubetrack replay --out` wrote", path.string())));
  }
  std::vector<TubeFrame> frames;
  std::string line;
  for (std::int64_t number = 1; std::getline(file, line); ++number) {
    if (line.empty()) continue;
    auto frame = parse_result_line(line);
    if (!frame) {
      return tl::make_unexpected(
          Error::failed(fmt::format("{}, line {}: {}", path.string(), number, frame.error().message)));
    }
    frames.push_back(std::move(*frame));
  }
  return frames;
}

}  // namespace tubetrack
