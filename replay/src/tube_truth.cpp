#include "tubetrack/replay/tube_truth.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tubetrack/sensors/json_problem.hpp"

namespace tubetrack {

namespace {

using OrderedJson = nlohmann::ordered_json;

TrueTube parse_tube(const OrderedJson& json) {
  TrueTube tube;
  tube.id = json.at("id").get<std::int64_t>();
  tube.radius_m = json.at("radius_m").get<double>();
  tube.length_m = json.at("length_m").get<double>();
  for (const OrderedJson& point : json.at("centerline_m")) {
    const auto xyz = point.get<std::array<double, 3>>();
    if (point.size() != 3) throw std::invalid_argument("centerline_m: a point takes 3 numbers");
    tube.centerline_m.emplace_back(xyz[0], xyz[1], xyz[2]);
  }
  tube.node_radius_m = json.value("node_radius_m", std::vector<double>());
  if (!tube.node_radius_m.empty() && tube.node_radius_m.size() != tube.centerline_m.size()) {
    throw std::invalid_argument(fmt::format("node_radius_m: got {} entries for {} points of centerline_m",
                                            tube.node_radius_m.size(), tube.centerline_m.size()));
  }
  // Recordings made before bends were written have none.
  for (const OrderedJson& bend : json.value("bends", OrderedJson::array())) {
    tube.bends.push_back({bend.at("bend_radius_m"), bend.at("angle_rad"), bend.at("rotation_rad")});
  }
  tube.visible = json.at("visible").get<std::vector<bool>>();
  if (tube.visible.size() != tube.centerline_m.size()) {
    throw std::invalid_argument(fmt::format("visible: got {} entries for {} points of centerline_m",
                                            tube.visible.size(), tube.centerline_m.size()));
  }
  return tube;
}

TruthFrame parse_frame(const std::string& line) {
  const OrderedJson json = OrderedJson::parse(line);
  TruthFrame frame;
  frame.frame = json.at("frame").get<std::int64_t>();
  frame.timestamp_s = json.at("timestamp_s").get<double>();
  frame.frame_id = json.at("frame_id").get<std::string>();
  for (const OrderedJson& tube : json.at("tubes")) frame.tubes.push_back(parse_tube(tube));
  return frame;
}

}  // namespace

Expected<std::vector<TruthFrame>> read_truth(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) return tl::make_unexpected(Error::failed(fmt::format("{}: cannot be opened", path.string())));
  std::vector<TruthFrame> frames;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    try {
      frames.push_back(parse_frame(line));
    } catch (const std::exception& problem) {
      return tl::make_unexpected(Error::failed(fmt::format("{}: line {}: {}; write it again with tubetrack synth",
                                                           path.string(), number, json_problem(problem))));
    }
  }
  return frames;
}

std::string truth_json(const TruthFrame& truth) {
  const auto micrometres = [](double metres) { return std::round(metres * 1e6) / 1e6; };
  OrderedJson json{{"frame", truth.frame}, {"timestamp_s", truth.timestamp_s}, {"frame_id", truth.frame_id}};
  json["tubes"] = OrderedJson::array();
  for (const TrueTube& tube : truth.tubes) {
    OrderedJson points = OrderedJson::array();
    for (const Eigen::Vector3d& p : tube.centerline_m) {
      points.push_back({micrometres(p.x()), micrometres(p.y()), micrometres(p.z())});
    }
    OrderedJson bends = OrderedJson::array();
    for (const TrueBend& bend : tube.bends) {
      bends.push_back(
          {{"bend_radius_m", bend.bend_radius_m}, {"angle_rad", bend.angle_rad}, {"rotation_rad", bend.rotation_rad}});
    }
    OrderedJson radii = OrderedJson::array();
    for (const double radius_m : tube.node_radius_m) radii.push_back(micrometres(radius_m));
    json["tubes"].push_back({{"id", tube.id},
                             {"radius_m", tube.radius_m},
                             {"length_m", tube.length_m},
                             {"centerline_m", std::move(points)},
                             {"bends", std::move(bends)},
                             {"visible", tube.visible}});
    if (!tube.node_radius_m.empty()) json["tubes"].back()["node_radius_m"] = std::move(radii);
  }
  return json.dump();
}

}  // namespace tubetrack
