#include "followed_extent.hpp"

#include <gtest/gtest.h>

#include "pool.hpp"
#include "tracker/tube_scene.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {
namespace {

using Eigen::Vector3d;

/// At rest, with a pool that knows every parameter, neighbours together, and says that the tube is where it is.
FollowedTube pooled_tube() {
  FollowedTube tube;
  tube.model = straight_model({0.01, -0.02, 0.8}, Vector3d(1.0, 0.3, 0.15).normalized(), 0.15, 0.0125);
  const Eigen::VectorXd parameters = parameters_of(tube.model);
  start_pool(tube);
  const Eigen::Index size = parameters.size();
  RecycledMatrix& matrix = tube.pooled.matrix;
  matrix = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = std::max<Eigen::Index>(0, i - 11); j < std::min(size, i + 12); ++j) {
      matrix(i, j) = 1e8 / (1.0 + static_cast<double>((i - j) * (i - j)));
    }
    matrix(i, size - 1) = matrix(size - 1, i) = 1e7;
  }
  tube.pooled.vector = matrix * parameters;
  tube.extent = {1.5, tube.model.spline.spans() - 1.5};
  return tube;
}

TEST(FollowedExtent, PixelsThatAnotherTubeHasDoNotCountAgainstAStretch) {
  Station station;
  station.expected = 30;
  station.agree = 10;
  EXPECT_FALSE(agrees(station));
  station.before = station.anothers = 18;
  EXPECT_TRUE(agrees(station));
  station.agree = 5;
  EXPECT_FALSE(agrees(station));
  station.before = station.anothers = 21;
  EXPECT_FALSE(agrees(station)) << "what is left says too little";
}

TEST(FollowedExtent, WhatIsPooledStaysTrueWhereTheSplineShrinksOrGrows) {
  for (const double begin : {0.5, 1.5, 3.0, 5.5}) {
    for (const double less : {0.5, 1.5, 3.0, 5.5}) {
      FollowedTube tube = pooled_tube();
      const double spans = tube.model.spline.spans();
      const Vector3d middle = point_at(tube.model.spline, 0.5 * spans);
      tube.extent = {begin, spans - less};
      const double into_extent = 0.5 * spans - begin;
      fit_spline_to_extent(tube);
      EXPECT_LT((point_at(tube.model.spline, tube.extent.t_begin + into_extent) - middle).norm(), 1e-12);
      const Eigen::VectorXd parameters = parameters_of(tube.model);
      ASSERT_EQ(tube.pooled.vector.size(), parameters.size());
      const Eigen::VectorXd pull = tube.pooled.vector - tube.pooled.matrix * parameters;
      EXPECT_LT(pull.norm(), 1e-9 * tube.pooled.vector.norm()) << begin << " " << less;
      EXPECT_LE(tube.extent.t_begin, 2.5);
      EXPECT_LE(tube.model.spline.spans() - tube.extent.t_end, 2.5);
    }
  }
}

}  // namespace
}  // namespace tubetrack
