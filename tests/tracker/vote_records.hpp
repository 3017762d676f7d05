#pragma once

#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <tuple>
#include <vector>

#include "tubetrack/tracker/accumulation_map.hpp"

namespace rc {

template <>
struct Arbitrary<tubetrack::VoteRecord> {
  static Gen<tubetrack::VoteRecord> arbitrary() {
    const auto part = gen::inRange(-1000, 1001);
    const auto place = gen::inRange(-40 * 4096, 40 * 4096);
    return gen::apply(
        [](const std::tuple<int, int, int>& origin, const std::tuple<int, int, int>& way, int first, int count,
           int weight) {
          Eigen::Vector3d direction(std::get<0>(way), std::get<1>(way), std::get<2>(way));
          if (direction.isZero()) direction = Eigen::Vector3d::UnitZ();
          direction *= 4096.0 / direction.norm();
          tubetrack::VoteRecord record;
          record.origin = {std::get<0>(origin), std::get<1>(origin), std::get<2>(origin)};
          for (std::size_t i = 0; i < 3; ++i) {
            record.direction[i] = static_cast<std::int32_t>(std::lround(direction[static_cast<Eigen::Index>(i)]));
          }
          record.first_step = static_cast<std::int16_t>(first);
          record.last_step = static_cast<std::int16_t>(first + count - 1);
          record.weight = weight;
          return record;
        },
        gen::tuple(place, place, place), gen::tuple(part, part, part), gen::inRange(0, 12), gen::inRange(0, 25),
        gen::inRange(1, 4));
  }
};

}  // namespace rc

namespace tubetrack {

using Records = std::vector<VoteRecord>;

inline AccumulationMap map_of(const Records& records) {
  AccumulationMap map(0.003);
  for (const VoteRecord& record : records) map.add(record);
  return map;
}

}  // namespace tubetrack
