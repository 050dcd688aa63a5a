#pragma once
// The standard model, from motor angles to the predicted reading, with all its derivatives. All of it runs in real time and
// needs Eigen alone. Not included, for the sake of compile time: shape and stability of the robot (mechanics/), effects and
// their history (effects/, recording/, friction/), controllers (control/), threads (parallel/), simulation/, calibration/.
#include "ctcr/actuation/transmission.hpp"
#include "ctcr/core/status.hpp"
#include "ctcr/core/types.hpp"
#include "ctcr/derivatives/parameters.hpp"
#include "ctcr/mechanics/model.hpp"
#include "ctcr/mechanics/solve.hpp"
#include "ctcr/robot/joints.hpp"
#include "ctcr/robot/parameters.hpp"
#include "ctcr/robot/robot.hpp"
#include "ctcr/robot/tip_load.hpp"
#include "ctcr/sensing/pose_sensor.hpp"
#include "ctcr/sensing/residual.hpp"
#include "ctcr/system/predict.hpp"
#include "ctcr/system/system.hpp"
