import { useState } from "preact/hooks";
import { loggedOutBy, login, tokenIn } from "../api";
import { Failure } from "../parts/failure";

/** `before`: why the login could not be checked. */
export function Login({ before }: { before: unknown }) {
  const [error, setError] = useState<unknown>();
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    const given = String(new FormData(event.currentTarget as HTMLFormElement).get("token")).trim();
    setError(undefined);
    login(tokenIn(given) ?? given).catch(setError);
  };
  const why = error ?? before ?? loggedOutBy.value;
  return (
    <form class="card login" onSubmit={submit}>
      <h1>Glasswing</h1>
      <label>
        Token, or a link with one
        <input name="token" type="password" required autocomplete="current-password" autofocus />
      </label>
      <button class="primary">Log in</button>
      <p class="note">
        On the rig's server, <code>glasswing console token</code> prints a link that logs you in.
      </p>
      {why !== undefined && <Failure error={why} />}
    </form>
  );
}
