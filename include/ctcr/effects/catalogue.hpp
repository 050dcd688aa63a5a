#pragma once
// The one registry of effects: a new effect is a file beside this one and a line here.
#include "ctcr/effects/anisotropy.hpp"
#include "ctcr/effects/backlash.hpp"
#include "ctcr/effects/clearance.hpp"
#include "ctcr/effects/contact.hpp"
#include "ctcr/effects/creep.hpp"
#include "ctcr/effects/delay.hpp"
#include "ctcr/effects/field_distortion.hpp"
#include "ctcr/effects/frame_motion.hpp"
#include "ctcr/effects/friction.hpp"
#include "ctcr/effects/periodic_error.hpp"
#include "ctcr/effects/precurvature.hpp"
#include "ctcr/effects/sensor_offset.hpp"
#include "ctcr/effects/softening.hpp"
#include "ctcr/effects/tip_load.hpp"
#include "ctcr/effects/torsional_compliance.hpp"

namespace ctcr {

/// All effects that ship with the library. Actuation first, then from the base to the tip, then the tracker.
using Catalogue = EffectList<Friction, BacklashRotation, BacklashTranslation, Delay, TipWeight, PrecurvatureProfile,
                             Softening, Anisotropy, StraightCurvature, Clearance, TorsionalCompliance, SensorOffset,
                             FieldDistortion, FrameDrift, FrameJump, PeriodicRotation, PeriodicTranslation,
                             EntryCompliance, EntryClearance, HelicalPrecurvature, Contact, Creep>;

}  // namespace ctcr
