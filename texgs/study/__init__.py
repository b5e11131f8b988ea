"""User studies of edited scenes: questions, the page for voters, ballots, and the table of votes."""
