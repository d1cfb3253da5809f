// Facts of a session that its archive knows.
#pragma once

#include <string>

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// The method that solves these frames unless a client names another: the plan's, else the one that its
// stimuli suit.
std::string usual_method(const v1::CaptureManifest& manifest);

// Sets frame_count and lost_frames of a video; clears both for a still.
void note_video(const v1::CaptureManifest& manifest, v1::Session& session);

// Sets the number of frames, their proofs and their bytes.
void note_frames(const v1::CaptureManifest& manifest, v1::Session& session);

}  // namespace glasswing
