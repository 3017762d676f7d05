#pragma once

#include <optional>

#include "normal_equations.hpp"

namespace tubetrack {

/// `fit_tube` of observations that are sorted already, by the model's own stretches.
std::optional<FitQuality> fit_tube(TubeModel& model, const SortedObservations& observations, const FitOptions& options);

/// Moves a model by a step: a control point by a radius at most, a free radius by three tenths of it. False where the
/// radius leaves its range.
bool move_by_step(TubeModel& model, const RecycledColumn& change, const FitOptions& options);

/// One step of it, from the model that the equations were made at; `gauss_newton_steps` doesn't count. The radius must
/// be the one that is held, if one is.
std::optional<FitQuality> take_step(TubeModel& model, ObservedEquations observed, const FitOptions& options);

}  // namespace tubetrack
