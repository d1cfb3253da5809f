// Facts about a session from its archive.
#pragma once

#include <string>

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// The method that solves these frames unless a client names another: the plan's, or else the one that suits
// its stimuli.
std::string usual_method(const v1::CaptureManifest& manifest);

// Sets frame_count and lost_frames of a video; clears both for a still.
void note_video(const v1::CaptureManifest& manifest, v1::Session& session);

// Sets the number of frames, their proofs and their bytes.
void note_frames(const v1::CaptureManifest& manifest, v1::Session& session);

}  // namespace glasswing
