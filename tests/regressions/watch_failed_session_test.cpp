// `glasswing watch` took a session whose second solve had failed for one under way, because it could be
// cancelled (for the matte of the first solve), and printed its summary twice.
#include "tests/client/fake_server.h"
#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

TEST(WatchFailedSession, PrintsItsReasonOnce) {
  FakeServer server;
  v1::Session& session = server.sessions_.session;
  session.set_name("vase");
  session.set_state(v1::SESSION_STATE_FAILED);
  session.set_reason("no solver could solve tile 3");
  session.set_matte_ready(true);
  for (const v1::SessionAction action :
       {v1::SESSION_ACTION_RETRY, v1::SESSION_ACTION_CANCEL, v1::SESSION_ACTION_SOLVE,
        v1::SESSION_ACTION_FETCH, v1::SESSION_ACTION_REPLICATE, v1::SESSION_ACTION_DELETE})
    session.add_allowed_actions(action);
  expect_one_line_error(run_glasswing({"watch", "vase", "--server", server.address()}), session.reason());
}

}  // namespace
}  // namespace glasswing
