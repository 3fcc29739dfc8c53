"""What is learnt: contact states, local regressors and their graph. Never imports Drake."""
