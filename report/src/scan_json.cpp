#include "tubetrack/report/scan_json.hpp"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "rounded.hpp"
#include "tubetrack/report/result_json.hpp"
#include "tubetrack/sensors/json_problem.hpp"

namespace tubetrack {

namespace {

using Json = nlohmann::ordered_json;

Json joint_json(const TubeJoint& joint) {
  const Eigen::Vector3d& p = joint.position_m;
  Json json{{"position_m", {micro(p.x()), micro(p.y()), micro(p.z())}}, {"tubes", Json::array()}};
  for (const TubeJoint::Part& part : joint.parts)
    json["tubes"].push_back({{"id", part.tube}, {"at", joint_part_name(part.at)}, {"along_m", micro(part.along_m)}});
  return json;
}

Json nominal_json(const NominalComparison& comparison, std::optional<double> tolerance_m) {
  Json json{{"nominal", comparison.nominal}};
  if (comparison.problem.empty()) {
    json["tube"] = comparison.tube;
    json["reversed"] = comparison.reversed;
    json["rms_m"] = micro(comparison.rms_m);
    json["max_deviation_m"] = micro(comparison.max_deviation_m);
    json["max_sheath_m"] = micro(comparison.max_sheath_m);
    json["points"] = Json::array();
    for (const NominalPoint& point : comparison.points) {
      json["points"].push_back({{"at", nominal_point_name(point.at)},
                                {"point", point.point},
                                {"deviation_m", micro(point.deviation_m)},
                                {"sheath_m", micro(point.sheath_m)}});
    }
  } else {
    json["error"] = comparison.problem;
  }
  if (tolerance_m) {
    json["tolerance_m"] = *tolerance_m;
    json["pass"] = comparison.within(*tolerance_m);
  }
  return json;
}

/// The value whose name is `text`, of those up to `last`.
template <class At>
At value_of(const std::string& text, std::string_view (*name)(At), At last) {
  for (int value = 0; value <= static_cast<int>(last); ++value) {
    if (name(static_cast<At>(value)) == text) return static_cast<At>(value);
  }
  throw std::runtime_error("\"at\": \"" + text + "\" is not known");
}

TubeJoint joint_from(const Json& json) {
  TubeJoint joint;
  const auto position = json.at("position_m").get<std::array<double, 3>>();
  joint.position_m = {position[0], position[1], position[2]};
  for (const Json& part : json.at("tubes")) {
    joint.parts.push_back({part.at("id").get<std::int64_t>(),
                           value_of(part.at("at").get<std::string>(), joint_part_name, TubeJoint::At::flank),
                           part.at("along_m").get<double>()});
  }
  return joint;
}

NominalComparison nominal_from(const Json& json) {
  NominalComparison comparison;
  comparison.nominal = json.at("nominal").get<std::int64_t>();
  comparison.problem = json.value("error", std::string());
  if (!comparison.problem.empty()) return comparison;
  comparison.tube = json.at("tube").get<std::int64_t>();
  comparison.reversed = json.at("reversed").get<bool>();
  comparison.rms_m = json.at("rms_m").get<double>();
  comparison.max_deviation_m = json.at("max_deviation_m").get<double>();
  comparison.max_sheath_m = json.at("max_sheath_m").get<double>();
  for (const Json& point : json.at("points")) {
    comparison.points.push_back({value_of(point.at("at").get<std::string>(), nominal_point_name, NominalPoint::At::end),
                                 point.at("point").get<std::size_t>(), point.at("deviation_m").get<double>(),
                                 point.at("sheath_m").get<double>()});
  }
  return comparison;
}

}  // namespace

Expected<ScanResult> parse_scan_line(std::string_view line) {
  auto frame = parse_result_line(line);
  if (!frame) return tl::make_unexpected(frame.error());
  ScanResult result;
  result.frame = std::move(*frame);
  try {
    const Json json = Json::parse(line);
    for (const Json& joint : json.value("joints", Json::array())) result.joints.push_back(joint_from(joint));
    for (const Json& nominal : json.value("nominal", Json::array())) {
      result.nominal.push_back(nominal_from(nominal));
      if (nominal.contains("tolerance_m")) result.tolerance_m = nominal.at("tolerance_m").get<double>();
    }
  } catch (const std::exception& problem) {
    return tl::make_unexpected(Error::failed("not a result of tubetrack: " + json_problem(problem)));
  }
  return result;
}

std::string line_with_findings(const TubeFrame& frame, bool with_timing, const Findings& findings) {
  Json more = Json::object();
  for (const TubeJoint& joint : findings.joints) more["joints"].push_back(joint_json(joint));
  for (const NominalComparison& comparison : findings.nominal)
    more["nominal"].push_back(nominal_json(comparison, findings.tolerance_m));
  std::string line = result_line(frame, with_timing);
  if (more.empty()) return line;
  // Both are objects: the second's keys go behind the first's.
  line.back() = ',';
  return line + more.dump().substr(1);
}

std::string_view joint_part_name(TubeJoint::At at) {
  switch (at) {
    case TubeJoint::At::start:
      return "start";
    case TubeJoint::At::end:
      return "end";
    default:
      return "flank";
  }
}

}  // namespace tubetrack
