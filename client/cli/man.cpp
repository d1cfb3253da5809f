#include "client/cli/commands.h"
#include "core/cli/man_page.h"

namespace glasswing {
namespace {

constexpr const char* kMore = R"(.SH EXIT STATUS
.TP
0
Success.
.TP
1
Failure; one line on standard error says why.
.TP
2
The command line or the configuration file is wrong.
.TP
3
\fBglasswing fsck\fR found damage that it did not repair.
.TP
130
Interrupted with Ctrl\-C.
.SH FILES
.TP
.I ~/.config/glasswing/config.toml
Settings, one line \fBkey\fR = \fB"value"\fR for each: server, ca, certificate, key, color. See \fBglasswing\-config\fR(1).
.SH ENVIRONMENT
.TP
.BR GLASSWING_SERVER ", " GLASSWING_CA ", " GLASSWING_CERTIFICATE ", " GLASSWING_KEY
Defaults of the options \-\-server, \-\-ca, \-\-certificate and \-\-key.
.TP
.B GLASSWING_CONFIG
The configuration file to read instead.
.TP
.B NO_COLOR
Disables colours, unless \-\-color is always.
)";

}  // namespace

void add_man_command(CLI::App& app, Client& client) {
  add_man_pages_command(app, client, kMore);
}

}  // namespace glasswing
