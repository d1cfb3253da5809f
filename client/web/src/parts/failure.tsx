/** What went wrong, in the words that came with it. */
export function Failure({ error }: { error: unknown }) {
  return (
    <p class="failure" role="alert">
      {error instanceof Error ? error.message : String(error)}
    </p>
  );
}
